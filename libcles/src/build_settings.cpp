// SPDX-License-Identifier: BSL-1.0
#include <cles/build_settings.hpp>

namespace cles::differs_from_the_library {

#define CLES_DEFINE(setting) const char setting = 0;
CLES_EACH_SETTING(CLES_DEFINE)
#undef CLES_DEFINE

} // namespace cles::differs_from_the_library
