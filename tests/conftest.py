"""Settings of all tests."""

import signal

from hypothesis import settings

settings.register_profile("mhvedit", deadline=None)  # a first call may have to load its kernels
settings.load_profile("mhvedit")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a background job of a shell: its commands would ignore it
    signal.signal(signal.SIGINT, signal.default_int_handler)
