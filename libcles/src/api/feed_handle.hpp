// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/feed.hpp>

#include "api/engine.hpp"
#include "node/publish/feed_machine.hpp"
#include "node/publish/feed_mailbox.hpp"
#include "node/publish/group_feeds.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/post.hpp>

#include <memory>
#include <string>
#include <utility>

namespace cles::api {

/// A feed that is bound through the multicast group, as its user holds it.
class group_feed_handle final : public detail::feed_control, public std::enable_shared_from_this<group_feed_handle> {
  public:
    /// \pre the service takes part in multicast
    group_feed_handle(std::shared_ptr<detail::engine> host, std::string target, std::string path);
    ~group_feed_handle() override;

    /// Completes as soon as the BIND has been sent: it is not answered.
    void start(detail::pending_ptr bound) override;
    void next(detail::event_ptr operation) override;
    void cancel_start() override;
    void cancel(const detail::pending_event* operation) override { feed_.mail().cancel(operation); }
    void close() override;
    [[nodiscard]] const boost::asio::any_io_executor& executor() const override { return host_->executor(); }

  private:
    void leave();

    std::shared_ptr<detail::engine> host_;
    core::group_feed feed_;
    bool starting_ = false;
    bool left_ = false; // and may be destroyed on any thread
};

/// The requested feed, or one whose `start` fails with the reason.
std::shared_ptr<detail::feed_control> make_group_feed(const std::shared_ptr<detail::engine>& host,
                                                      const protocol::noun_view& noun, std::string path,
                                                      const bind_options& options);

/// One call of `async_next`: completes with the next event or an error, never inside this call. `owner` keeps the
/// mailbox.
inline void fetch_next(core::feed_mailbox& from, const boost::asio::any_io_executor& executor,
                       std::shared_ptr<detail::feed_control> owner, detail::event_ptr operation) {
    if (from.closed() || from.has_waiter()) {
        const auto code = make_error_code(from.closed() ? errc::stopped : errc::busy);
        boost::asio::post(executor, [operation = std::move(operation), code]() mutable {
            operation.release()->fail(code, code == errc::busy ? "another async_next of this feed waits"
                                                               : "the feed is closed");
        });
        return;
    }
    if (from.next(std::move(operation))) {
        boost::asio::post(executor, [&from, owner = std::move(owner)] { from.pump(); });
    }
}

/// A feed as its user holds it.
class feed_handle final : public detail::feed_control, public std::enable_shared_from_this<feed_handle> {
  public:
    feed_handle(std::shared_ptr<detail::engine> host, std::string target, std::string path, bool thinned);
    ~feed_handle() override;

    [[nodiscard]] core::feed_machine& machine() noexcept { return machine_; }

    void start(detail::pending_ptr bound) override;
    void next(detail::event_ptr operation) override;
    void cancel_start() override;
    void cancel(const detail::pending_event* operation) override { machine_.mail().cancel(operation); }
    void close() override;
    [[nodiscard]] const boost::asio::any_io_executor& executor() const override { return host_->executor(); }

  private:
    std::shared_ptr<detail::engine> host_;
    core::feed_machine machine_;
    bool left_ = false; // and may be destroyed on any thread
};

/// A feed whose `start` fails with this reason.
std::shared_ptr<detail::feed_control> make_refused_feed(std::shared_ptr<detail::engine> host,
                                                        boost::system::error_code code, std::string message);

} // namespace cles::api
