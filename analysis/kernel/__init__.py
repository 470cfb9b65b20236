"""One reference, and any number of pictures measured against it.

``phase_kernel`` is the public interface. A ``reference`` is ``prepared`` ZOI by ZOI (``quadrature`` for the
paper's estimator); ``solve`` measures a picture and tries lost ZOIs again, ``result`` is the field. ``warm_up``
compiles ahead. ``images`` and ``settings`` have what is given.
"""
