// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "core/group_output.hpp"
#include "core/group_session.hpp"
#include "core/group_source.hpp"
#include "transport/group_port.hpp"

#include <memory>
#include <string_view>

namespace cles::detail {
class engine;
} // namespace cles::detail

namespace cles::shell {

/// A service's place in its multicast group.
class group final : public core::group_output, private transport::group_events {
  public:
    /// Joins. \throws cles::error: `invalid_url`, `insecure_listen`, or the system's code
    group(detail::engine& host, const multicast_options& where, bool insecure);
    ~group();

    /// Begins to listen; to be called once.
    void start();
    /// Says goodbye, leaves, and ends the feeds; repeating it does nothing.
    void stop();
    /// To all nodes of the group. What is not sent is counted.
    bool send(std::string_view line) override;
    void send_all(std::string_view lines) override;
    [[nodiscard]] bool has_room() const override { return port_->unsent() == 0; }
    [[nodiscard]] core::group_session& session() noexcept { return session_; }
    /// Where what this node sends comes from.
    [[nodiscard]] const core::group_source& source() const noexcept { return source_; }

  private:
    bool put(std::string_view lines);
    void on_datagram(const transport::group_datagram& datagram) override;
    void on_batch() override;
    void on_room() override;

    detail::engine& engine_;
    std::shared_ptr<transport::group_port> port_;
    core::group_source source_;
    core::group_session session_;
};

} // namespace cles::shell
