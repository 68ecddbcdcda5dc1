// SPDX-License-Identifier: BSL-1.0

// The compiled part of Asio, for the library and for programs that define BOOST_ASIO_SEPARATE_COMPILATION.
//
// Its functions are compiled as inline functions that are all emitted, as a program without that definition emits those
// that it uses. So the linker merges both: one definition of each function, and of the objects inside functions (error
// categories, the state of signals), however each part of a program was compiled.
#define BOOST_ASIO_DECL inline __attribute__((used))
#include <boost/asio/impl/src.hpp>
