// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/version.hpp>

#include <cstddef> // configures the standard library

/// Settings that change the types which a program and the library have in common. If the program is compiled with
/// others than the library, it does not link: the linker reports, for example, an undefined reference to
/// `cles::differs_from_the_library::no_rtti`.
///
/// Those of Asio are read from what a program defines, so that it makes no difference whether Asio has been included.

#if defined(__cpp_rtti) && !defined(BOOST_ASIO_NO_TYPEID)
#define CLES_SETTING_RTTI rtti
#else
#define CLES_SETTING_RTTI no_rtti
#endif

#if defined(_GLIBCXX_DEBUG)
#define CLES_SETTING_CONTAINERS glibcxx_debug
#else
#define CLES_SETTING_CONTAINERS no_glibcxx_debug
#endif

#if !defined(_GLIBCXX_USE_CXX11_ABI) || _GLIBCXX_USE_CXX11_ABI
#define CLES_SETTING_STRINGS glibcxx_use_cxx11_abi
#else
#define CLES_SETTING_STRINGS no_glibcxx_use_cxx11_abi
#endif

#if defined(BOOST_ASIO_CUSTOM_HANDLER_TRACKING)
#define CLES_SETTING_HANDLERS asio_custom_handler_tracking
#elif defined(BOOST_ASIO_ENABLE_HANDLER_TRACKING)
#define CLES_SETTING_HANDLERS asio_enable_handler_tracking
#else
#define CLES_SETTING_HANDLERS no_asio_handler_tracking
#endif

#if defined(_GLIBCXX_DEBUG) && defined(BOOST_ASIO_DISABLE_BUFFER_DEBUGGING)
#define CLES_SETTING_BUFFERS asio_disable_buffer_debugging
#elif defined(BOOST_ASIO_ENABLE_BUFFER_DEBUGGING) || defined(_GLIBCXX_DEBUG)
#define CLES_SETTING_BUFFERS asio_buffer_debugging
#else
#define CLES_SETTING_BUFFERS no_asio_buffer_debugging
#endif

#if defined(BOOST_ASIO_DISABLE_THREADS)
#define CLES_SETTING_THREADS asio_disable_threads
#else
#define CLES_SETTING_THREADS asio_threads
#endif

#if defined(BOOST_ASIO_HAS_IO_URING) && defined(BOOST_ASIO_DISABLE_EPOLL)
#define CLES_SETTING_REACTOR asio_io_uring_without_epoll
#elif defined(BOOST_ASIO_HAS_IO_URING)
#define CLES_SETTING_REACTOR asio_has_io_uring
#elif defined(BOOST_ASIO_DISABLE_EPOLL)
#define CLES_SETTING_REACTOR asio_disable_epoll
#else
#define CLES_SETTING_REACTOR asio_epoll
#endif

#if defined(BOOST_ASIO_USE_TS_EXECUTOR_AS_DEFAULT)
#define CLES_SETTING_EXECUTORS asio_use_ts_executor_as_default
#elif defined(BOOST_ASIO_NO_TS_EXECUTORS)
#define CLES_SETTING_EXECUTORS asio_no_ts_executors
#else
#define CLES_SETTING_EXECUTORS asio_ts_executors
#endif

#define CLES_SETTING_NAME(number) boost_version_##number
#define CLES_SETTING_OF(number) CLES_SETTING_NAME(number)
#define CLES_SETTING_BOOST CLES_SETTING_OF(BOOST_VERSION)

#define CLES_EACH_SETTING(use)                                                                                         \
    use(CLES_SETTING_RTTI) use(CLES_SETTING_CONTAINERS) use(CLES_SETTING_STRINGS) use(CLES_SETTING_HANDLERS)           \
        use(CLES_SETTING_BUFFERS) use(CLES_SETTING_THREADS) use(CLES_SETTING_REACTOR) use(CLES_SETTING_EXECUTORS)      \
            use(CLES_SETTING_BOOST)

namespace cles {

/// The library defines those that it is compiled with.
namespace differs_from_the_library {
#define CLES_DECLARE(setting) extern const char setting; // NOLINT(bugprone-macro-parentheses): it is a name
CLES_EACH_SETTING(CLES_DECLARE)
#undef CLES_DECLARE
} // namespace differs_from_the_library

/// A reference to each, which linkers that discard unused sections keep.
namespace detail::used_settings {
#define CLES_REFER(setting)                                                                                            \
    [[gnu::used, gnu::retain]] inline const char* const setting = &differs_from_the_library::setting;
CLES_EACH_SETTING(CLES_REFER)
#undef CLES_REFER
} // namespace detail::used_settings

} // namespace cles
