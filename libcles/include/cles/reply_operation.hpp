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
        if (read_json(reader, value) && reader.at_end()) {
            return pending::verdict::completed;
        }
    } catch (const std::exception& thrown) {
        judge_thrown(thrown, code, why, what);
        return pending::verdict::completed;
    }
    return judge_unread(reader, json, code, why, what);
}

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
            using carrier = std::conditional_t<comes_wrapped<T>, wrapped<T>, T>;
            carrier value{};
            if (read_result(json, value, code, why) == verdict::malformed) {
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

    void discard() noexcept override { discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    template <class... V>
    void finish(boost::system::error_code code, const std::string& message, V&&... value) {
        if (code && diagnostics_ != nullptr) {
            *diagnostics_ = message;
        }
        end_operation(this, complete_, code, message, std::forward<V>(value)...);
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

/// The memory for a result of type T.
template <class T>
class reply_value {
  public:
    [[nodiscard]] reply_target target(std::string* diagnostics) noexcept { return {&carrier_, read, diagnostics}; }
    [[nodiscard]] T& get() noexcept {
        if constexpr (comes_wrapped<T>) {
            return carrier_.value;
        } else {
            return carrier_;
        }
    }

  private:
    using carrier = std::conditional_t<comes_wrapped<T>, wrapped<T>, T>;

    static pending::verdict read(std::string_view json, void* value, boost::system::error_code& code,
                                 std::string& why) {
        return read_result(json, *static_cast<carrier*>(value), code, why);
    }

    carrier carrier_{};
};

/// A pending request of a coroutine. Its type does not depend on that of the result, which is read into the coroutine's
/// memory. The handler owns the coroutine.
template <class Handler>
class awaited_operation final : public pending {
  public:
    awaited_operation(Handler handler, const boost::asio::any_io_executor& service, const reply_target& target)
        : complete_(std::move(handler), service), target_(target) {}

    verdict offer(std::string_view json) override {
        boost::system::error_code code;
        std::string why;
        if (target_.read(json, target_.value, code, why) == verdict::malformed) {
            return verdict::malformed;
        }
        finish(code, why);
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        finish(code, std::string{message}); // the view may refer to memory of the handler
    }
    void discard() noexcept override { discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    void finish(boost::system::error_code code, const std::string& message) {
        if (code && target_.diagnostics != nullptr) {
            *target_.diagnostics = message;
        }
        end_operation(this, complete_, code, message);
    }

    completion<true, Handler> complete_;
    reply_target target_;
};

} // namespace cles::detail
