// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/deadlines.hpp"
#include "node/publish/topic.hpp"
#include "node/routing/deferred_request.hpp"
#include "node/routing/relays.hpp"
#include "node/routing/request_router.hpp"
#include "node/session/call.hpp"
#include "node/session/request_checks.hpp"
#include "protocol/request_line.hpp"

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// A noun that one link binds for `all`: at the known publishers, and at each that appears later. The reply contains
/// the last value of each.
class all_binding final : public deferred_request, private deadline {
  public:
    all_binding(std::shared_ptr<request_router> by, const protocol::request_line& r, relayed_path path,
                relayed_bindings& place, binding::terms wanted, std::shared_ptr<call> answers, time_point due);

    /// Returns false if it has to wait for more nodes to be discovered.
    bool begin(time_point now) override;
    [[nodiscard]] bool over() const override { return closed_; }
    /// The nodes that publish the noun may have changed.
    void follow();
    /// Whether its requester may still bind what it has bound.
    [[nodiscard]] bool is_permitted() const;
    /// Ends all bindings except those that `heir` has too. Does not use `place` afterwards.
    void close(const all_binding* heir = nullptr);

  private:
    struct part : node_outcome {
        bool asked = true;      // until it has replied
        bool bound = false;     // with a failure too, if there was no memory for its last value
        bool held_back = false; // this node may not forward for the requester
    };

    [[nodiscard]] bool may_bind_here() const;
    [[nodiscard]] passage may_bind_at(std::string_view node) const;
    void bind_known(time_point now);
    void join(const std::string& node);
    void on_result(const std::string& node, topic* t, std::string_view last, const std::optional<update_mark>& mark,
                   const protocol::failure& why);
    void on_deadline(time_point now) override;
    void reply_when_complete();
    void answer();
    void withdraw() override;

    protocol::owned_request request_;
    relayed_path path_;
    relayed_bindings& place_;
    binding::terms wanted_;
    std::map<std::string, part, std::less<>> parts_; // by node
    bool begun_ = false;
    bool joining_ = false;
    bool closed_ = false;
};

} // namespace cles::core
