// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/onward.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string_view>

namespace cles::shell {

class local_node;

class upstream_feed;

/// The routes of a service, as its router uses them for its clients.
class ways final : public core::onward {
  public:
    explicit ways(local_node& host) noexcept : host_(host) {}
    ~ways();
    /// Closes all feeds.
    void stop();

    std::uint64_t send(const request& r, detail::pending_ptr reply,
                       core::outbound::progress_function progress) override;
    void withdraw(std::uint64_t ticket) override;
    std::uint64_t bind(std::string_view node, std::string_view path, std::string_view adverbs,
                       core::feed_events& to) override;
    void unbind(std::uint64_t ticket) override;

  private:
    local_node& host_;
    std::map<std::uint64_t, std::shared_ptr<upstream_feed>> feeds_;
};

} // namespace cles::shell
