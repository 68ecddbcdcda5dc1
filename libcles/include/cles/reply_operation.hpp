// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/completion.hpp>
#include <cles/convert.hpp>
#include <cles/convert_chrono.hpp>
#include <cles/convert_wrapped.hpp>
#include <cles/error.hpp>
#include <cles/pending.hpp>

#include <exception>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

/// Pending requests, and the conversion of replies to values. Not for applications.

namespace cles::detail {

/// Classifies a result that could not be read: `malformed` if it is not JSON; otherwise sets `code` to `conversion`.
/// \param reader where it failed
pending::verdict judge_unread(const json_reader& reader, std::string_view json, boost::system::error_code& code,
                              std::string& why, std::string_view what);
/// As `judge_unread`, for a user's conversion that threw.
void judge_thrown(const std::exception& thrown, boost::system::error_code& code, std::string& why,
                  std::string_view what);

/// Reads a T from the text of a result.
template <class T>
pending::verdict read_result(std::string_view json, T& value, boost::system::error_code& code, std::string& why,
                             std::string_view what = "the answer") {
    json_reader reader{json, answer_depth};
    try {
        if (cles::read_json(reader, value) && reader.at_end()) {
            return pending::verdict::completed;
        }
    } catch (const std::exception& thrown) {
        judge_thrown(thrown, code, why, what);
        return pending::verdict::completed;
    }
    return judge_unread(reader, json, code, why, what);
}

/// What a result of type T is read into.
template <class T>
using reply_carrier = std::conditional_t<comes_wrapped<T>, wrapped<T>, T>;

template <class T, bool Throws, class Handler>
class reply_operation final : public pending {
  public:
    reply_operation(Handler handler, const boost::asio::any_io_executor& service, std::string* diagnostics)
        : complete_(std::move(handler), service), diagnostics_(diagnostics) {}

    verdict offer(std::string_view json) override {
        boost::system::error_code code;
        std::string why;
        if constexpr (std::is_void_v<T>) {
            if (!is_valid_answer(json)) {
                return verdict::malformed;
            }
            finish(code, why);
        } else {
            reply_carrier<T> value{};
            if (detail::read_result(json, value, code, why) == verdict::malformed) {
                return verdict::malformed;
            }
            if constexpr (comes_wrapped<T>) {
                finish(code, why, std::move(value.value));
            } else {
                finish(code, why, std::move(value));
            }
        }
        return verdict::completed;
    }

    void fail(boost::system::error_code code, std::string_view message) override {
        const std::string text{message}; // the view may refer to memory of the handler
        if constexpr (std::is_void_v<T>) {
            finish(code, text);
        } else {
            finish(code, text, T{});
        }
    }

    void discard() noexcept override { detail::discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    template <class... V>
    void finish(boost::system::error_code code, const std::string& message, V&&... value) {
        if (code && diagnostics_ != nullptr) {
            *diagnostics_ = message;
        }
        detail::end_operation(this, complete_, code, message, std::forward<V>(value)...);
    }

    completion<Throws, Handler> complete_;
    std::string* diagnostics_;
};

/// Where the result of a request is read to.
struct reply_target {
    void* value;
    pending::verdict (*read)(std::string_view json, void* value, boost::system::error_code& code, std::string& why);
    std::string* diagnostics;
};

/// Reads an awaited result into a `reply_carrier<T>`.
template <class T>
pending::verdict read_reply(std::string_view json, void* value, boost::system::error_code& code, std::string& why) {
    return detail::read_result(json, *static_cast<reply_carrier<T>*>(value), code, why);
}

} // namespace cles::detail
