// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/publisher.hpp>
#include <cles/service.hpp>

#include "asio/asio_environment.hpp"
#include "node/local_node.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

namespace cles::detail {

class posted_updates;

/// The implementation of a service: a node over Asio, the program's handlers, and its updates from other threads.
class engine final : public core::local_node {
  public:
    engine(const boost::asio::any_io_executor& executor, service_options options);

    [[nodiscard]] const boost::asio::any_io_executor& executor() const noexcept { return asio_.executor(); }
    void add(registration offered);
    bool remove(cles::verb verb, std::string_view offered);
    /// Receives updates from other threads.
    std::shared_ptr<update_sink> cross_thread_updates();
    std::uint64_t close(std::chrono::milliseconds limit, pending_ptr operation);
    /// Does nothing in a child process, whose parent goes on with the service.
    void stop() override;
    /// Whether this is a child process, whose parent goes on with the service. Then nothing of it may end: that would
    /// send lines on the parent's links, set its timer, or remove the files of its sockets.
    [[nodiscard]] bool belongs_to_parent() const noexcept { return !asio_.process().is_this(); }
    /// Keeps a part of a service that belongs to the parent for as long as this process lives.
    static void keep(std::shared_ptr<const void> part);

  private:
    engine(std::shared_ptr<asio_port::asio_environment> by, service_options options);

    const asio_port::asio_environment& asio_;        // the node's environment
    std::shared_ptr<posted_updates> posted_updates_; // created when the program first publishes from other threads
};

/// The requested feed, or one whose `start` fails with the reason. \param most updates that wait in it; 0: as many as
/// `limits::feed`
std::shared_ptr<feed_control> make_feed(const std::shared_ptr<engine>& host, std::string_view noun,
                                        const bind_options& options, std::size_t most = 0);

} // namespace cles::detail
