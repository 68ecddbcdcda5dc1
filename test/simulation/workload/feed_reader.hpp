// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include "node/publish/feed_mailbox.hpp"
#include "simulation/world/node_run.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

/// What a published body says of itself.
struct published_mark {
    std::uint64_t number = 0; ///< of its noun, from 1; 0 where it says nothing
    unsigned run = 0;         ///< of the publisher
};
[[nodiscard]] published_mark mark_of(std::string_view json);

/// A program that reads a feed: fetches what comes, quickly, slowly, or not for a while.
class feed_reader : public std::enable_shared_from_this<feed_reader> {
  public:
    feed_reader(node_run& at, std::uint32_t label, std::chrono::milliseconds slow)
        : node_(at), local_(at.shared_local()), label_(label), slow_(slow) {}
    feed_reader(const feed_reader&) = delete;
    feed_reader& operator=(const feed_reader&) = delete;
    virtual ~feed_reader() = default;

    /// Does not fetch for so long.
    void hold(std::chrono::milliseconds time);
    [[nodiscard]] std::uint32_t label() const noexcept { return label_; }
    [[nodiscard]] node_run& at() noexcept { return node_; }
    [[nodiscard]] const node_run& at() const noexcept { return node_; }
    [[nodiscard]] virtual std::string name() const = 0;

  protected:
    /// From now on it fetches.
    void begin();
    /// Kept, as a feed keeps its service.
    [[nodiscard]] core::local_node& local() noexcept { return *local_; }
    [[nodiscard]] bool has_begun() const noexcept { return begun_; }
    void complain(rule which, const std::string& what) { node_.watcher().broken(which, name() + " " + what); }

  private:
    class next_event;

    virtual core::feed_mailbox& mail() = 0;
    virtual void on_event(const detail::raw_event& event) = 0;
    void fetch();
    void take(const detail::raw_event& event);

    node_run& node_;
    std::shared_ptr<core::local_node> local_;
    std::uint32_t label_;
    std::chrono::milliseconds slow_;
    bool begun_ = false;
    bool waits_ = false;
    bool held_ = false;
    bool fetch_planned_ = false;
};

} // namespace cles::simulation
