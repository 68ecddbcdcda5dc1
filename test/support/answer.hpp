// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include <ostream>
#include <string>
#include <utility>

namespace cles {

inline std::ostream& operator<<(std::ostream& out, errc code) { return out << make_error_code(code).message(); }

} // namespace cles

namespace cles::test {

/// The outcome of a request. Must outlive the request.
template <class T = json_text>
struct answer {
    int calls = 0;
    boost::system::error_code code{};
    T value{};
    std::string words{}; ///< the peer's message

    /// The completion handler; one type for all tests, which saves compile time.
    struct taker {
        answer* to;
        void operator()(boost::system::error_code failed, T result) const {
            ++to->calls;
            to->code = failed;
            to->value = std::move(result);
        }
    };
    taker take() { return {this}; }
    /// Options that store the peer's message here.
    call_options options() { return call_options{}.diagnostics(words); }

    [[nodiscard]] bool done() const noexcept { return calls != 0; }
};

/// An operation without a result.
template <>
struct answer<void> {
    int calls = 0;
    boost::system::error_code code{};

    struct taker {
        answer* to;
        void operator()(boost::system::error_code failed) const {
            ++to->calls;
            to->code = failed;
        }
    };
    taker take() { return {this}; }

    [[nodiscard]] bool done() const noexcept { return calls != 0; }
};

} // namespace cles::test
