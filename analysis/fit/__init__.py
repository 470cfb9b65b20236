"""One ZOI fitted and judged, in compiled loops: import its modules by name.

``sensitivity`` makes the normal equations, ``iteration`` solves them, ``shapes`` detect what an affine fit
cannot follow, ``verdict`` gives the status, ``assembly`` residual, covariances and saturated shares, ``sums`` the noise
of means; ``kernel_args`` are the arguments of these loops, ``validity`` has the limits.
"""
