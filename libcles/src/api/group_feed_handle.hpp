// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed.hpp>

#include "api/engine.hpp"
#include "core/group_feed.hpp"

#include <memory>
#include <string>

namespace cles::api {

/// A feed that is bound by the multicast group, as its user holds it.
class group_feed_handle final : public detail::feed_control, public std::enable_shared_from_this<group_feed_handle> {
  public:
    /// The service takes part in multicast.
    group_feed_handle(std::shared_ptr<detail::engine> host, std::string target, std::string path);
    ~group_feed_handle() override;

    /// Completes as soon as the BIND has been sent, for nobody answers it.
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

/// The feed that was asked for, or one whose `start` fails with the reason why there can be none.
std::shared_ptr<detail::feed_control> make_group_feed(const std::shared_ptr<detail::engine>& host,
                                                      const protocol::noun_view& noun, std::string path,
                                                      const bind_options& options);

} // namespace cles::api
