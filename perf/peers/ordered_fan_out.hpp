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

/// How a publisher of any middleware is told what to publish: by a socket beside it, so that the middleware carries
/// nothing but what is measured.
namespace cles::perf::peers {

/// Announces where the middleware publishes, together with where orders are taken, and publishes as ordered until the
/// one who orders has gone.
void publish_by_order(const std::string& where, const announce& tell,
                      const std::function<void(const publication&)>& publish);

/// The subscriptions of a middleware, as long as this lives. Where it has threads of its own, they bring to the inbox
/// what comes.
class subscriptions {
  public:
    subscriptions() = default;
    subscriptions(const subscriptions&) = delete;
    subscriptions& operator=(const subscriptions&) = delete;
    virtual ~subscriptions() = default;
    /// Brings what comes, for so long or until the inbox has all that it waits for.
    virtual void take_for(std::chrono::milliseconds at_most, inbox& into) { into.wait_for(at_most); }
};

class ordered_fan_out final : public fan_out {
  public:
    /// Gets where the middleware publishes, and an inbox for as many subscribers.
    using subscribe = std::function<std::unique_ptr<subscriptions>(const std::string& where, inbox& into)>;

    /// \param announced by `publish_by_order`
    ordered_fan_out(const std::string& announced, std::size_t subscribers, const subscribe& how);
    fan_out_tally run(const fan_out_order& order, latency_recorder* record) override;

  private:
    void reach_all();
    void order(const fan_out_order& what);
    /// Whether what was ordered has been published.
    bool published();

    inbox inbox_;
    descriptor control_;
    std::unique_ptr<subscriptions> subscriptions_;
};

} // namespace cles::perf::peers
