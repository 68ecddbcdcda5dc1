// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::test {

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
inline constexpr bool with_sanitizer = true;
#elif defined __has_feature
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
inline constexpr bool with_sanitizer = true;
#else
inline constexpr bool with_sanitizer = false;
#endif
#else
inline constexpr bool with_sanitizer = false;
#endif

/// How much a test runs that computes for long. With a sanitizer each step takes several times as long, and what counts
/// is that all code has run: there, a fixed part of the seeds, in smaller networks.
template <class T>
constexpr T amount(T whole, T part) {
    return with_sanitizer ? part : whole;
}

} // namespace cles::test
