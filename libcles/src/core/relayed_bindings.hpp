// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/call.hpp"
#include "core/link_bindings.hpp"
#include "core/relays.hpp"
#include "core/topic.hpp"

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class all_binding;

/// What the peer of one link is bound to on other nodes, through this one: nouns of theirs by name, and those of all
/// who publish them. `own`: what it is bound to here, of which `all` is a part.
class relayed_bindings {
  public:
    relayed_bindings(publications& published, link_bindings& own, std::shared_ptr<relays> from, binder& updates)
        : published_(published), own_(own), from_(std::move(from)), bound_(*from_, updates) {}
    relayed_bindings(const relayed_bindings&) = delete;
    relayed_bindings& operator=(const relayed_bindings&) = delete;
    ~relayed_bindings();

    /// Binds a noun of another node, and answers when that has. BIND again changes the terms.
    void bind(std::string_view node, std::string_view path, std::string_view adverbs, binding::terms wanted,
              bool wants_mark, const std::shared_ptr<call>& c);
    /// Binds a noun of all who publish it, from now on. What was so before is given back, to be closed.
    std::shared_ptr<all_binding> bind_all(std::string_view path, std::shared_ptr<all_binding> all) {
        return std::exchange(all_[std::string{path}], std::move(all));
    }
    /// What has not been bound yet is not bound any more.
    void unbind(std::string_view target, std::string_view path);
    void clear();
    void drain(time_point now) { bound_.drain(now); }
    [[nodiscard]] bool binds(std::string_view target, std::string_view path);
    [[nodiscard]] std::size_t size() const noexcept { return bound_.size() + all_.size(); }
    [[nodiscard]] bool empty() const noexcept { return size() == 0; }

    // For what is bound by `all`. What is bound by name too is left as it is.
    /// Binds a noun of another node to its topic.
    void take_part(topic& t, binding::terms wanted);
    void leave_part(std::string_view noun);
    /// The same for this node's own. Null where it is none that can be bound.
    topic* take_own_part(std::string_view path, binding::terms wanted);
    void leave_own_part(std::string_view path);
    [[nodiscard]] const std::shared_ptr<relays>& from() const noexcept { return from_; }

  private:
    struct asking {
        std::string noun;
        std::weak_ptr<call> answers; // which counts what it holds until it goes
    };
    void withdraw(std::string_view noun);

    publications& published_;
    link_bindings& own_;
    std::shared_ptr<relays> from_;
    link_bindings bound_;
    std::vector<std::string> by_name_;    // nouns of other nodes that were bound by name
    std::vector<std::string> own_by_all_; // paths of this node that were not
    std::vector<asking> asking_;
    std::map<std::string, std::shared_ptr<all_binding>, std::less<>> all_; // by path
};

} // namespace cles::core
