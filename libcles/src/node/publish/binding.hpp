// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/deadlines.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class topic;

/// The end of a link that receives updates.
class subscriber {
  public:
    subscriber() = default;
    subscriber(const subscriber&) = delete;
    subscriber& operator=(const subscriber&) = delete;
    /// Whether it takes more updates now; if not, it requests the rest when it does.
    [[nodiscard]] virtual bool takes_updates() const = 0;
    virtual void put_updates(std::string_view lines) = 0;
    /// The publisher of a noun that it has bound through this node denies it from now on. Ends no binding inside the
    /// call.
    virtual void on_denied() {}

  protected:
    ~subscriber() = default;
};

/// One subscriber's position in a topic.
class binding final : public deadline {
  public:
    struct terms {
        std::chrono::milliseconds every{0};
        std::uint32_t keep = 64;

        bool operator==(const terms&) const = default;
    };

    /// It gets the updates after the one with the number `seen`.
    binding(topic& source, subscriber& target, terms wanted, std::uint64_t seen)
        : source_(source), target_(target), terms_(wanted), seen_(seen) {}

    /// Sends the subscriber its pending updates, as far as it takes them.
    void drain(time_point now);
    /// The same, without waiting for `every`.
    [[gnu::cold]] void drain_last(time_point now);
    /// Does nothing if they are the same: the binding is renewed.
    void set_terms(terms wanted) noexcept;
    [[nodiscard]] subscriber& target() const noexcept { return target_; }
    /// Whether updates are pending for it.
    [[nodiscard]] bool is_behind() const noexcept;

  private:
    friend topic;
    void on_deadline(time_point now) override { drain(now); }
    void drain_newest(time_point now);
    void drain_all();

    topic& source_;
    subscriber& target_;
    terms terms_;
    std::uint64_t seen_;    // the last update that it was sent, or that was dropped for it
    time_point next_due_{}; // with `every`: no update earlier
};

/// Where a link's peer finds what it binds: the topics that the node publishes, or those that it relays.
class topic_source {
  public:
    topic_source() = default;
    topic_source(const topic_source&) = delete;
    topic_source& operator=(const topic_source&) = delete;

    /// The topic, or null.
    [[nodiscard]] virtual topic* find(std::string_view path) noexcept = 0;
    /// A subscriber has gone; the topic may be removed.
    virtual void release(topic& t) = 0;
    /// A subscriber has taken its pending updates.
    virtual void admit(topic& t) = 0;

  protected:
    ~topic_source() = default;
};

/// The bindings of one link's peer.
class link_bindings {
  public:
    link_bindings(topic_source& source, subscriber& target) noexcept : source_(source), target_(target) {}
    link_bindings(const link_bindings&) = delete;
    link_bindings& operator=(const link_bindings&) = delete;

    [[nodiscard]] bool has(std::string_view path) noexcept;
    /// Binds, or changes the terms of a binding.
    void bind(topic& t, binding::terms wanted);
    /// Does nothing if it is not bound.
    [[gnu::cold]] void unbind(std::string_view path);
    void clear();
    /// Sends pending updates: the link is writable again.
    void drain(time_point now);
    /// The same, also those that `every` would let wait: no others may follow.
    [[gnu::cold]] void drain_last(time_point now);
    /// Whether updates wait to be sent.
    [[nodiscard, gnu::cold]] bool is_behind() const noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return topics_.size(); }

  private:
    void release(topic& t);

    topic_source& source_;
    subscriber& target_;
    std::vector<topic*> topics_;
};

/// The leases of bindings that were made by datagram: a binding ends when its lease expires, unless it is renewed.
template <class Key>
class leases {
  public:
    /// `over` is called with the key of a binding whose lease has expired.
    leases(deadline_queue& deadlines, std::function<void(const Key&)> over)
        : deadlines_(deadlines), over_(std::move(over)) {}

    /// Starts or renews a lease.
    void set(const Key& key, time_point until) {
        deadlines_.arm(open_.try_emplace(key, *this, key).first->second, until);
    }
    /// Does nothing if there is none.
    void drop(const Key& key) {
        if (const auto found = open_.find(key); found != open_.end()) {
            open_.erase(found);
        }
    }
    [[nodiscard]] bool contains(const Key& key) const { return open_.contains(key); }
    void clear() { open_.clear(); }

  private:
    struct lease final : deadline {
        lease(leases& all, Key what) : owner(all), key(std::move(what)) {}
        void on_deadline(time_point) override {
            const auto ended = key;
            auto& all = owner;
            all.drop(ended); // destroys this
            all.over_(ended);
        }

        leases& owner;
        Key key;
    };

    deadline_queue& deadlines_;
    std::function<void(const Key&)> over_;
    std::map<Key, lease> open_;
};

} // namespace cles::core
