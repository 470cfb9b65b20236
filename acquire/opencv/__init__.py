"""What is read through OpenCV: ``webcam``, ``video`` files and ``images`` as cameras."""
