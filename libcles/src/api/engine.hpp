// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/publisher.hpp>
#include <cles/service.hpp>

#include "asio/asio_environment.hpp"
#include "asio/outside_updates.hpp"
#include "shell/local_node.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <memory>

namespace cles::detail {

/// The inside of a service: a node over Asio, the handlers of the program, and its updates from other threads.
class engine final : public shell::local_node {
  public:
    engine(const boost::asio::any_io_executor& executor, service_options options);

    [[nodiscard]] const boost::asio::any_io_executor& executor() const noexcept { return asio_.executor(); }
    void add(registration offered);
    /// Where updates go that come from other threads.
    std::shared_ptr<update_sink> outside_updates();
    void stop() override;

  private:
    engine(std::shared_ptr<asio_port::asio_environment> by, service_options options);
    [[nodiscard]] std::weak_ptr<engine> weak();

    const asio_port::asio_environment& asio_;                     // the node's environment
    std::shared_ptr<asio_port::outside_updates> outside_updates_; ///< once the program wants to publish from elsewhere
};

} // namespace cles::detail
