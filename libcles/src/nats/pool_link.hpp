// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include "federation/bridge_link.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::nats {

class pool_link;

/// The other end of the links between a node and its bridge. The functions are called inside those of the links.
class pool_link_owner {
  public:
    pool_link_owner() = default;
    pool_link_owner(const pool_link_owner&) = delete;
    pool_link_owner& operator=(const pool_link_owner&) = delete;

    virtual void on_line(const bridging::bridge_link& from, std::string_view line) = 0;
    /// `hand_over` is to be called in a task.
    virtual void schedule(std::shared_ptr<pool_link> which) = 0;
    /// Lines have been passed.
    virtual void on_flushed() = 0;
    virtual void on_closed(pool_link& which) = 0;
    /// Bytes that wait to be sent to NATS, on all links together.
    [[nodiscard]] virtual std::size_t unsent() const = 0;
    /// Bytes that were given to NATS to be sent, ever, on all links together; sent in this order.
    [[nodiscard]] virtual std::uint64_t given() const = 0;

  protected:
    ~pool_link_owner() = default;
};

/// A link between a node and its bridge, on which the node sees another pool as a neighbour.
class pool_link final : public link, public std::enable_shared_from_this<pool_link> {
  public:
    /// What may wait for NATS, on all links together, before links count as slow.
    static constexpr std::size_t capacity = 65'536;
    /// Bytes that may wait for the node before it is full.
    static constexpr std::size_t inbox_capacity = 1U << 20U;

    /// \param member the authenticated name of the other end; empty: it has none
    pool_link(std::weak_ptr<pool_link_owner> by, bridging::bridge_link which, const std::string& own_pool,
              std::string member = {});
    /// Of the other end of such a link.
    [[nodiscard]] static identity identity_of(const bridging::bridge_link& which, const std::string& own_pool,
                                              std::string member);

    void start(std::shared_ptr<link_events> owner) override;
    std::string& output() override { return output_; }
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override { return output_.size() + excess(); }
    [[nodiscard]] std::uint64_t sent() const noexcept override;
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    void pause(bool stop) override;
    void finish() override;
    void close() override;
    [[nodiscard]] std::size_t buffered() const noexcept override { return output_.capacity(); }
    void shrink() override { output_.shrink_to_fit(); }
    [[nodiscard]] const identity& peer() const noexcept override { return peer_; }

    // For the bridge.
    [[nodiscard]] const bridging::bridge_link& which() const noexcept { return which_; }
    /// Queues a line for the node.
    void deliver(std::string line);
    /// The node takes less than arrives: lines that it can do without are not to be delivered.
    [[nodiscard]] bool is_full() const noexcept { return inbox_bytes_ > inbox_capacity; }
    /// The binding of that noun is lost, once the node has received what was delivered before.
    void lose_binding(std::string noun, std::string_view why);
    /// The same of the link.
    void lose(std::string_view why);
    [[nodiscard]] bool is_lost() const noexcept { return lost_; }
    /// Passes what is queued to the node, as far as it accepts it. What a handler throws passes through; then call it
    /// again.
    void hand_over();
    /// After `unsent` was above its limit, more can be written.
    void on_writable();

  private:
    // Bytes that were given to NATS for this link without a break, up to a position in all that was given.
    struct given_bytes {
        std::uint64_t end;
        std::uint64_t total; // of the link, with these
        std::uint64_t size;
    };

    [[nodiscard]] std::size_t waiting() const noexcept;
    [[nodiscard]] std::size_t excess() const noexcept;
    void note_given(std::uint64_t before);
    void schedule();
    void hand_over_lines(const std::shared_ptr<link_events>& owner);
    void clear_inbox();
    void end();

    std::weak_ptr<pool_link_owner> by_;
    bridging::bridge_link which_;
    identity peer_;
    std::shared_ptr<link_events> owner_;
    std::string output_;
    std::deque<std::string> inbox_;
    std::size_t inbox_bytes_ = 0;
    std::vector<std::pair<std::string, std::string>> bindings_lost_; // nouns, and why
    bool lost_ = false;
    std::deque<given_bytes> given_; // that may not be sent yet
    std::uint64_t given_total_ = 0;
    std::uint64_t flushed_ = 0;
    std::uint64_t received_ = 0;
    bool paused_ = false;
    bool scheduled_ = false;
    bool closed_ = false;
    bool finishing_ = false;
    bool was_full_ = false;
};

} // namespace cles::nats
