"""Settings of all tests."""

from hypothesis import settings

settings.register_profile("mhvedit", deadline=None)  # a first call may have to load its kernels
settings.load_profile("mhvedit")
