"""The benchmark, ``make bench``; it stops with advice where OpenCV does not work."""

from live.commands.process import limit_resources

limit_resources()  # as the program does, before numpy is loaded
try:
    import cv2

    cv2.DISOpticalFlow_create  # type: ignore[attr-defined]  # noqa: B018 - an OpenCV torn by its neighbours still imports, empty
except (ImportError, AttributeError) as error:
    raise SystemExit(
        f"OpenCV does not work here ({error}). pyvale and SUN-DIC bring builds of their own which overwrite ours; "
        "this puts it right: python -m pip install --force-reinstall --no-deps opencv-contrib-python-headless"
    ) from error
