// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/metrics.hpp"
#include "node/node_state.hpp"
#include "node/publish/topic.hpp"
#include "node/routing/next_hop.hpp"
#include "node/session/call.hpp"
#include "port/request_origin.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// A path of another node, bound for a client.
struct relayed_path {
    std::string text;
    owned_origin by{}; ///< in a secured fleet, whose rights apply

    // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the resulting zero for a pointer
    auto operator<=>(const relayed_path&) const = default;
    /// Identifies the noun and its requester among those of a node: "car2:pose", "car2:pose from=car1". No noun
    /// contains a space.
    [[nodiscard]] std::string key(std::string_view node) const;
};

/// Forwards to this node's clients what other nodes publish, by nouns such as "car2:pose". Each noun is bound once for
/// each requester, whose rights the publisher checks, as long as clients use it. Its updates are forwarded as received;
/// thinning and queuing happen here, separately for each client.
class relays final : public topic_source {
  public:
    relays(node_state& host, next_hop& out);
    ~relays();
    void stop();

    /// Receives the topic to bind to, the noun's last value, and which update that is, if it is known; or null and the
    /// reason.
    using result_callback = std::function<void(topic*, std::string_view last, const std::optional<update_mark>& mark,
                                               const protocol::failure& why)>;
    /// Binds a noun. Calls `done` once, at once if the noun is bound already, and not if `whose` has expired.
    void join(const forwarding_permit& permit, const relayed_path& path, const std::weak_ptr<const void>& whose,
              result_callback done);

    [[nodiscard]] topic* find(std::string_view noun) noexcept override;
    void release(topic& t) override;
    void admit(topic&) override {}

    [[nodiscard]] node_state& host() const noexcept { return node_; }

  private:
    class relay;

    node_state& node_;
    next_hop& out_;
    counters counts_; // separate: forwarded updates do not count as published by this node
    std::map<std::string, std::unique_ptr<relay>, std::less<>> all_;
    bool stopped_ = false;
};

class all_binding;

/// The bindings of one link's peer at other nodes, through this one: single nouns, and nouns of all their publishers.
/// `own`: its bindings at this node, of which some belong to `all`.
class relayed_bindings {
  public:
    relayed_bindings(publications& published, link_bindings& own, std::shared_ptr<relays> from, subscriber& updates)
        : published_(published), own_(own), from_(std::move(from)), bound_(*from_, updates) {}
    relayed_bindings(const relayed_bindings&) = delete;
    relayed_bindings& operator=(const relayed_bindings&) = delete;
    ~relayed_bindings();

    /// Binds a noun of another node, and replies when that node has. A further BIND changes the terms.
    void bind(const forwarding_permit& permit, const relayed_path& path, binding::terms wanted, bool wants_mark,
              const std::shared_ptr<call>& c);
    /// Binds a noun of all its publishers from now on. Returns the previous binding of that noun, to be closed.
    std::shared_ptr<all_binding> bind_all(const relayed_path& path, std::shared_ptr<all_binding> all) {
        return std::exchange(all_[path], std::move(all));
    }
    /// Ends a binding, or a BIND that is still in progress.
    void unbind(std::string_view target, const relayed_path& path);
    void clear();
    /// Those that this node may no longer pass on: targets and paths.
    [[nodiscard]] std::vector<std::pair<std::string, relayed_path>> forbidden(const node_state& host) const;
    void drain(time_point now) { bound_.drain(now); }
    [[nodiscard]] bool binds(std::string_view target, const relayed_path& path);
    [[nodiscard]] std::size_t size() const noexcept { return bound_.size() + all_.size(); }
    [[nodiscard]] bool empty() const noexcept { return size() == 0; }

    // For bindings of `all`. A binding by name is left unchanged.
    /// Binds the topic of another node's noun.
    void take_part(topic& t, binding::terms wanted);
    void leave_part(std::string_view noun);
    /// The same for a noun of this node. Null if it cannot be bound.
    topic* take_own_part(std::string_view path, binding::terms wanted);
    void leave_own_part(std::string_view path);
    [[nodiscard]] const std::shared_ptr<relays>& from() const noexcept { return from_; }

  private:
    struct asking {
        std::string noun;
        std::weak_ptr<call> answers; // weak: a call accounts for memory as long as it exists
    };
    void withdraw(std::string_view noun);
    [[nodiscard]] bool is_by_name(std::string_view key) const;

    publications& published_;
    link_bindings& own_;
    std::shared_ptr<relays> from_;
    link_bindings bound_;
    struct named {
        std::string key;
        std::string node;
        relayed_path path;
    };
    std::vector<named> by_name_;          // nouns of other nodes, bound by name
    std::vector<std::string> own_by_all_; // paths of this node, bound by `all` only
    std::vector<asking> asking_;
    std::map<relayed_path, std::shared_ptr<all_binding>> all_;
};

} // namespace cles::core
