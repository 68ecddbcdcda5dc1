// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "inbox.hpp"
#include "peer.hpp"
#include "perf/support/descriptor.hpp"

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

/// How a publisher of any middleware receives its orders: by a separate socket, so that the middleware carries only
/// what is measured.
namespace cles::perf::peers {

/// Announces the address of the control socket together with `where` the middleware publishes, and publishes as ordered
/// until the control connection is closed.
void publish_by_order(const std::string& where, const announce& tell,
                      const std::function<void(const publication&)>& publish);

/// The subscriptions of a middleware, while this object exists. If the middleware has threads of its own, they fill the
/// inbox.
class subscriptions {
  public:
    subscriptions() = default;
    subscriptions(const subscriptions&) = delete;
    subscriptions& operator=(const subscriptions&) = delete;
    virtual ~subscriptions() = default;
    /// Fills the inbox until it has all that it waits for, but no longer than this.
    virtual void take_for(std::chrono::milliseconds at_most, inbox& into) { into.wait_for(at_most); }
};

class ordered_fan_out final : public fan_out {
  public:
    /// Creates subscriptions, given where the middleware publishes, and an inbox.
    using subscribe = std::function<std::unique_ptr<subscriptions>(const std::string& where, inbox& into)>;

    /// \param announced by `publish_by_order`
    ordered_fan_out(const std::string& announced, std::size_t subscribers, const subscribe& how);
    fan_out_tally run(const fan_out_order& order, latency_recorder* record) override;

  private:
    void reach_all();
    void order(const fan_out_order& what);
    /// Whether all has been published.
    bool published();

    inbox inbox_;
    descriptor control_;
    std::unique_ptr<subscriptions> subscriptions_;
};

} // namespace cles::perf::peers
