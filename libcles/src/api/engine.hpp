// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/publisher.hpp>
#include <cles/service.hpp>

#include "asio/asio_environment.hpp"
#include "asio/cross_thread_updates.hpp"
#include "node/local_node.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <memory>

namespace cles::detail {

/// The implementation of a service: a node over Asio, the program's handlers, and its updates from other threads.
class engine final : public core::local_node {
  public:
    engine(const boost::asio::any_io_executor& executor, service_options options);

    [[nodiscard]] const boost::asio::any_io_executor& executor() const noexcept { return asio_.executor(); }
    void add(registration offered);
    /// Receives updates from other threads.
    std::shared_ptr<update_sink> cross_thread_updates();
    void stop() override;

  private:
    engine(std::shared_ptr<asio_port::asio_environment> by, service_options options);
    [[nodiscard]] std::weak_ptr<engine> weak();

    const asio_port::asio_environment& asio_; // the node's environment
    std::shared_ptr<asio_port::cross_thread_updates>
        cross_thread_updates_; ///< created when the program first publishes from other threads
};

} // namespace cles::detail
