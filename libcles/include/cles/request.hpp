// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/convert_chrono.hpp>
#include <cles/convert_wrapped.hpp>
#include <cles/error.hpp>
#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/verb.hpp>

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace cles {

class request;

namespace detail {

struct request_data {
    cles::verb verb = verb::pull;
    std::string_view node;
    std::string_view task;
    std::span<const std::string_view> parameters;
    std::string_view body = "{}";
    const identity* peer = nullptr;
    time_point deadline{};
    std::string_view trace{};
    std::string_view requester{};
    std::string_view forwarded_by{};
};

/// Makes a copy that owns its text.
std::shared_ptr<const request_data> own(const request_data& data);

/// False if the text is not a number, or out of range. Defined for all types that `std::from_chars` reads.
template <class T>
bool read_number(std::string_view text, T& number) noexcept;

[[noreturn]] void throw_bad_parameter(std::size_t index);
[[noreturn]] void throw_bad_body(const std::string& why);

} // namespace detail

/// A request as its handler receives it: decoded, validated and addressed to this node.
///
/// In a handler that is a plain function, it is valid until the function returns. A copy owns its text and may be kept;
/// coroutines take their argument by value and so own it. Not thread-safe until copied; copies may be read from any
/// thread.
class request {
  public:
    explicit request(const detail::request_data& borrowed) noexcept : data_(&borrowed) {}
    request(const request& other)
        : owned_(other.owned_ ? other.owned_ : detail::own(*other.data_)), data_(owned_.get()) {}
    request& operator=(const request& other) {
        if (this != &other) {
            owned_ = other.owned_ ? other.owned_ : detail::own(*other.data_);
            data_ = owned_.get();
        }
        return *this;
    }
    ~request() = default;

    [[nodiscard]] cles::verb verb() const noexcept { return data_->verb; }
    /// The node that serves it.
    [[nodiscard]] std::string_view node() const noexcept { return data_->node; }
    [[nodiscard]] std::string_view task() const noexcept { return data_->task; }
    /// The parameters after the task, percent-decoded.
    [[nodiscard]] std::span<const std::string_view> parameters() const noexcept { return data_->parameters; }
    /// The JSON body; `{}` if there is none.
    [[nodiscard]] std::string_view body() const noexcept { return data_->body; }
    /// The other end of the link on which the request has arrived. If another node has forwarded the request, that is
    /// this node, not the requester. The reference is valid as long as this request.
    [[nodiscard]] const identity& peer() const noexcept { return *data_->peer; }
    /// In a secured fleet, the member whose request it is, and whose rights have been checked; the node itself for
    /// requests of its own programs and of its user. Empty without security, where nobody proves a name.
    [[nodiscard]] std::string_view requester() const noexcept { return data_->requester; }
    /// In a secured fleet, the member that has forwarded the request for the requester, as it may by the roster; it is
    /// the peer. Empty if the requester itself is the peer, and without security.
    [[nodiscard]] std::string_view forwarded_by() const noexcept { return data_->forwarded_by; }
    /// When the requester stops waiting.
    [[nodiscard]] time_point deadline() const noexcept { return data_->deadline; }
    /// The trace that it belongs to, for `call_options::trace` of the requests that it causes; empty if there is none.
    [[nodiscard]] std::string_view trace() const noexcept { return data_->trace; }

    /// The parameter at `index` (from 0) as text or a number.
    /// \throws cles::error with `bad_request` if it is missing, not a number or out of range
    template <class T = std::string_view>
    [[nodiscard]] T parameter(std::size_t index) const {
        const auto text = parameter_text(index);
        if constexpr (std::is_arithmetic_v<T>) {
            static_assert(!std::is_same_v<T, bool>, "a parameter is text or a number");
            T number{};
            if (!detail::read_number(text, number)) {
                detail::throw_bad_parameter(index);
            }
            return number;
        } else {
            return T{text};
        }
    }

    /// The body as a T; scalars are unwrapped from {"value":x}.
    /// \throws cles::error with `bad_request`, naming the path to the part that does not fit
    template <class T>
    [[nodiscard]] T as() const {
        constexpr bool made_first = std::is_default_constructible_v<T>;
        static_assert(made_first, "the type of a body needs a default constructor: it is made first, and then read");
        if constexpr (made_first) {
            using carrier = std::conditional_t<detail::comes_wrapped<T>, detail::wrapped<T>, T>;
            carrier value{};
            std::string why;
            if (!cles::from_json(body(), value, &why)) {
                detail::throw_bad_body(why);
            }
            if constexpr (detail::comes_wrapped<T>) {
                return std::move(value.value);
            } else {
                return value;
            }
        }
    }

  private:
    [[nodiscard]] std::string_view parameter_text(std::size_t index) const;

    std::shared_ptr<const detail::request_data> owned_;
    const detail::request_data* data_;
};

} // namespace cles
