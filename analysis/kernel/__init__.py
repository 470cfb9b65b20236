"""One reference, and any number of pictures measured against it.

``phase_kernel`` is the public interface. A ``reference`` is ``prepared`` ZOI by ZOI (``quadrature`` for the
paper's estimator); ``solve`` measures a picture and retries lost ZOIs, ``result`` is the field. ``warm_up``
compiles ahead.
"""
