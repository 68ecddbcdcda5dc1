// SPDX-License-Identifier: BSL-1.0
#include "core/routing.hpp"

#include <cles/routing.hpp>

#include "shell/local_node.hpp"
#include "shell/routing_part.hpp"
#include "shell/ways.hpp"

#include <memory>

namespace cles {
namespace {

class host final : public detail::routing_host {
  public:
    explicit host(shell::local_node& node)
        : ways_(node), routing_(std::make_shared<core::routing>(node.shared_node(), ways_, node.environment().random(),
                                                                [&node] { node.turns().ask(); })) {}

    void hold() override { routing_->hold(); }
    void release(time_point now) override { routing_->release(now); }
    void go_on(time_point now) override {
        routing_->begin_ready(now);
        routing_->drain(now);
    }
    void stop() override {
        routing_->stop();
        ways_.stop();
    }

  private:
    shell::ways ways_;
    std::shared_ptr<core::routing> routing_;
};

} // namespace

const detail::routing_part* routing() noexcept {
    static constexpr detail::routing_part part{
        [](shell::local_node& node) -> std::unique_ptr<detail::routing_host> { return std::make_unique<host>(node); }};
    return &part;
}

} // namespace cles
