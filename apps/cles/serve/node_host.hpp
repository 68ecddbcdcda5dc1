// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "client/logging.hpp"
#include "serve/node_arguments.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>

#include <functional>
#include <optional>

namespace tool {

/// A node that this program runs until a signal, or until another node turns out to have its name.
class node_host {
  public:
    /// Listens at once. \throws what `node_arguments::options` and the service throw
    node_host(const node_arguments& args, int verbosity);
    node_host(const node_host&) = delete;
    node_host& operator=(const node_host&) = delete;

    [[nodiscard]] boost::asio::io_context& context() noexcept { return io_; }
    [[nodiscard]] cles::service& node() noexcept { return *node_; }
    void log(cles::log_level level, const cles::log_entry& what) const { log_.sink()(level, what); }

    /// Prints where the node listens, and runs it. \param on_stop called once, before the node stops
    /// \return the exit code
    int run(std::function<void()> on_stop, const cles::run_options& how = {});
    /// Ends `run`, which returns that code.
    void stop(int code);
    /// The same, when what has been published and answered is sent, for which it waits a second at most.
    void finish(int code);

  private:
    server_log log_;
    boost::asio::io_context io_{1};
    boost::asio::signal_set signals_;
    std::optional<cles::service> node_;
    std::function<void()> on_stop_;
    std::optional<int> code_; // set when it stops
};

} // namespace tool
