"""One ZOI fitted and judged, in compiled loops: import its modules by name.

``sensitivity`` and ``moments`` make the normal equations, ``iteration`` solves them, ``shapes`` see a bent
displacement, ``clipping`` sees saturated pixels, ``validity`` has the limits and ``verdict`` the status,
``assembly`` puts residual and covariances together; ``bundles`` are what these loops take and give.
"""
