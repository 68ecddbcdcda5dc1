// SPDX-License-Identifier: BSL-1.0
#include <cles/routing.hpp>

#include "node/local_node.hpp"
#include "node/routing/next_hop.hpp"
#include "node/routing/request_router.hpp"
#include "node/routing/router.hpp"

#include <memory>

namespace cles {
namespace {

class host final : public detail::routing_service {
  public:
    explicit host(core::local_node& node)
        : next_hop_(node),
          routing_(std::make_shared<core::request_router>(node.shared_node(), next_hop_, node.environment().random(),
                                                          [&node] { node.flush_scheduler().schedule_turn(); })) {}

    void hold() override { routing_->hold(); }
    void release() override { routing_->release(); }
    void run_ready(time_point now) override { routing_->begin_ready(now); }
    void stop() override {
        routing_->stop();
        next_hop_.stop();
    }

  private:
    core::peer_next_hop next_hop_;
    std::shared_ptr<core::request_router> routing_;
};

} // namespace

const detail::routing_part* routing() noexcept {
    static constexpr detail::routing_part part{[](core::local_node& node) -> std::unique_ptr<detail::routing_service> {
        return std::make_unique<host>(node);
    }};
    return &part;
}

} // namespace cles
