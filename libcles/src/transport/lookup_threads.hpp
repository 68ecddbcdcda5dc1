// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "transport/name_lookups.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/system/error_code.hpp>

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

namespace cles::transport {

class host_lookup;

/// The threads on which the names of one execution context are looked up. The threads share it with the context, which
/// may end before they do: then they use nothing of the context any more.
class lookup_threads : public std::enable_shared_from_this<lookup_threads> {
  public:
    /// Those of the executor's context.
    [[nodiscard]] static std::shared_ptr<lookup_threads> of(const boost::asio::any_io_executor& executor);

    /// Starts a thread, as `start_detached` does.
    using starter = std::function<boost::system::error_code(std::function<void()> function)>;
    explicit lookup_threads(starter start);

    /// Begins a lookup of the name. Posts `host_lookup::on_outcome`, with the outcome set, unless it is forgotten.
    void start(const std::shared_ptr<host_lookup>& by, const boost::asio::any_io_executor& executor, std::string name);
    void forget(const std::string& name, name_lookups::ticket who);
    void prefer(std::string_view place, const boost::asio::ip::address& answered);
    [[nodiscard]] std::optional<boost::asio::ip::address> preferred(std::string_view place);

    // For the context.
    /// Nothing is posted any more.
    void close();
    void before_fork();
    void after_fork(bool is_child);

  private:
    struct waiter {
        std::weak_ptr<host_lookup> by;
        boost::asio::any_io_executor executor;
    };
    using lock = std::unique_lock<std::mutex>;

    /// Not held in a child process that has not taken over the context: a thread of the parent may have held it.
    [[nodiscard]] lock hold();
    void start_thread(const std::string& name);
    void run(std::string name);
    [[nodiscard]] std::optional<std::string> finish(const std::string& name, name_lookups::outcome found);
    void deliver(const std::vector<name_lookups::ticket>& to, const name_lookups::outcome& found);

    std::mutex mutex_; // guards what follows
    starter starter_;
    std::atomic<::pid_t> process_;
    bool closed_ = false;
    name_lookups names_{{}};
    name_lookups::ticket last_ticket_ = 0;
    std::map<name_lookups::ticket, waiter> waiters_;
};

} // namespace cles::transport
