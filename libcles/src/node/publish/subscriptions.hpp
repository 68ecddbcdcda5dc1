// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/string_map.hpp"
#include "node/publish/subscription.hpp"
#include "protocol/request_line.hpp"
#include "protocol/update_head.hpp"

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The subscriptions on one link, by noun: one for each publisher and noun, or several that share a binding.
class subscriptions {
  public:
    /// Returns false if the noun is, or may be, bound on this link already, and that binding cannot be shared.
    bool add(subscription& s);
    [[nodiscard]] bool admits(const subscription& s) const;
    void remove(const subscription& s);
    /// Whether another subscription is bound whose binding this one may share.
    [[nodiscard]] bool has_bound_for(const subscription& s) const;
    [[nodiscard]] bool has(std::string_view target, std::string_view path) const;
    /// The subscription that an update is for, or null.
    [[nodiscard]] subscription* find(std::string_view publisher, std::string_view path) const;

    /// An update and its subscription. `update` is null if the line was not recognised, `whose` if nobody wants the
    /// update.
    struct match {
        const protocol::request_line* update = nullptr;
        subscription* whose = nullptr;
    };
    /// Recognises an update that follows one of the same noun. The result is valid until the next call.
    [[nodiscard]] match recognise(std::string_view line) noexcept;
    /// Finds the subscription for a parsed update. Remembers the update's head when updates of the noun follow each
    /// other.
    [[nodiscard]] match find(std::string_view line, const protocol::request_line& update);
    /// Delivers an update to its subscription and to those that share the binding. False if it is new to none of them.
    bool deliver(const match& found);
    [[nodiscard]] bool empty() const noexcept { return by_path_.empty(); }

  private:
    void forget_last() noexcept;
    [[nodiscard]] const std::vector<subscription*>& all_of(std::string_view path) const;

    // Usually one node publishes a path on a link, so a short list is faster than a second key.
    string_map<std::vector<subscription*>> by_path_;
    std::size_t sharing_ = 0;         // those that share another's binding
    subscription* last_ = nullptr;    // receiver of the previous update
    subscription* head_of_ = nullptr; // receiver of updates with the remembered head
    protocol::update_head head_;
    std::string scratch_;
};

} // namespace cles::core
