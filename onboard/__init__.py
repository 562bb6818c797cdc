"""The drone: what it knows and computes, and the one door to it."""

from onboard.kernel_cache import use_cache_of_this_source

use_cache_of_this_source()
