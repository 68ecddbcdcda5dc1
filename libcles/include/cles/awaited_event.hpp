// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed.hpp>

#include <string>
#include <string_view>
#include <utility>

/// How an `async_next` of a coroutine starts and completes. Not for applications.

namespace cles::detail {

/// A pending `async_next` of a coroutine. Its type does not depend on that of the value, which is read into the
/// coroutine's memory. The handler owns the coroutine.
template <class Handler>
class awaited_event final : public pending_event {
  public:
    awaited_event(Handler handler, const boost::asio::any_io_executor& service, const event_target& target)
        : complete_(std::move(handler), service), target_(target) {}

    bool deliver(const raw_event& event) override {
        std::string why;
        boost::system::error_code code;
        if (!target_.read(event, target_.value, code, why)) {
            return false;
        }
        detail::end_operation(this, complete_, code, why);
        return true;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        detail::end_operation(this, complete_, code,
                              std::string{message}); // the view may refer to memory of the handler
    }
    void discard() noexcept override { detail::discard_operation(this, complete_); }
    [[nodiscard]] bool elsewhere() const noexcept { return complete_.elsewhere(); }

  private:
    completion<true, Handler> complete_;
    event_target target_;
};

template <class Handler>
void awaited_next::start(Handler handler) {
    if (from.control) {
        detail::start_next<awaited_event<Handler>>(from, std::move(handler), target);
    } else {
        detail::fail_later<true>(std::move(handler), from.fallback, errc::closed, not_open);
    }
}

} // namespace cles::detail
