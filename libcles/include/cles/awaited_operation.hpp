// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <string>
#include <string_view>
#include <utility>

/// How a request of a coroutine starts and completes. Not for applications.

namespace cles::detail {

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
    void discard() noexcept override { detail::discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    void finish(boost::system::error_code code, const std::string& message) {
        if (code && target_.diagnostics != nullptr) {
            *target_.diagnostics = message;
        }
        detail::end_operation(this, complete_, code, message);
    }

    completion<true, Handler> complete_;
    reply_target target_;
};

template <class Handler>
void awaited_request::start(Handler handler) {
    auto slot = boost::asio::get_associated_cancellation_slot(handler);
    auto* operation =
        detail::make_operation<awaited_operation<Handler>>(std::move(handler), from.get_executor(), target);
    from.start(detail::about_to_start(operation, slot), request, options);
}

} // namespace cles::detail
