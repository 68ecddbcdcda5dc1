// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/publisher.hpp>

#include <boost/asio/any_io_executor.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::asio_port {

/// Updates from any thread on their way to the service's executor: what a `publisher` writes to. They wait in a list of
/// bounded length, whose oldest entries are dropped first.
class cross_thread_updates final : public detail::update_sink,
                                   public std::enable_shared_from_this<cross_thread_updates> {
  public:
    /// Takes an update on the executor.
    using taker = std::function<void(std::string_view noun, std::string_view json)>;
    /// Called with the number of updates dropped since its last call.
    using dropped = std::function<void(std::size_t count)>;

    cross_thread_updates(boost::asio::any_io_executor executor, taker take, dropped tell)
        : executor_(std::move(executor)), take_(std::move(take)), tell_(std::move(tell)) {}

    void publish(std::string_view noun, std::string_view json) override;
    /// After this, nothing is posted. Call it on the executor.
    void close();

    static constexpr std::size_t max_waiting = 1024;
    static constexpr std::size_t max_bytes = 4U << 20U;

  private:
    using entry = std::pair<std::string, std::string>;
    static std::size_t size_of(const entry& e) noexcept { return e.first.size() + e.second.size(); }
    void drain();

    boost::asio::any_io_executor executor_;
    taker take_;
    dropped tell_;
    std::mutex mutex_; // guards what follows
    std::vector<entry> waiting_;
    std::size_t first_ = 0; ///< the first that waits; those before have been dropped
    std::size_t bytes_ = 0;
    std::size_t dropped_ = 0;
    bool asked_ = false;
    bool closed_ = false;
};

} // namespace cles::asio_port
