// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include "node/publish/group_feeds.hpp"
#include "simulation/workload/feed_reader.hpp"
#include "simulation/world/node_run.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace cles::simulation {

/// A feed of a simulated program by the multicast group, that keeps account of what comes of each publisher.
class group_follower final : public feed_reader {
  public:
    /// `target`: a node's name, or "all".
    group_follower(node_run& at, std::uint32_t label, std::string target, std::string path,
                   std::chrono::milliseconds slow);
    ~group_follower() override { leave(); }

    void start();
    void close();

    [[nodiscard]] bool is_open() noexcept { return has_begun() && !feed_.mail().closed(); }
    [[nodiscard]] bool wants(std::string_view node) const noexcept { return node != at().name() && feed_.wants(node); }
    [[nodiscard]] const std::string& path() const noexcept { return feed_.path(); }
    /// The last update that it was given of that publisher.
    [[nodiscard]] published_mark last_of(std::string_view publisher) const;
    [[nodiscard]] std::string name() const override;

  private:
    struct source {
        published_mark last;
        std::uint64_t missed = 0; // told since then
    };

    core::feed_mailbox& mail() override { return feed_.mail(); }
    void on_event(const detail::raw_event& event) override;
    void leave();
    void on_gap(const detail::raw_event& event);
    void on_update(const detail::raw_event& event);

    core::group_feed feed_;
    std::map<std::string, source, std::less<>> sources_;
    std::uint64_t shed_ = 0; // told as missed, but not of whom
    bool left_ = false;
};

} // namespace cles::simulation
