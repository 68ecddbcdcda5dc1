// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed.hpp>

#include "api/engine.hpp"
#include "core/feed_machine.hpp"

#include <memory>
#include <string>

namespace cles::api {

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

/// A feed that could not even begin; its `start` fails with the reason.
std::shared_ptr<detail::feed_control> make_refused_feed(std::shared_ptr<detail::engine> host,
                                                        boost::system::error_code code, std::string message);

} // namespace cles::api
