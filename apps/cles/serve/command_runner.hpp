// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>

#include <boost/asio/io_context.hpp>

#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace tool {

/// Answers requests by a program, which runs once for each of them: the body is its stdin, and its exit code and stdout
/// are the answer (`outcome_of`). Some run at once; further requests wait. The program of a request that is cancelled,
/// or whose requester is gone, is stopped.
class command_runner : public std::enable_shared_from_this<command_runner> {
  public:
    using log_function = std::function<void(cles::log_level level, const std::string& text)>;

    struct settings {
        std::vector<std::string> words{}; ///< of the command
        std::size_t at_once = 1;          ///< how many programs may run at the same time
        bool takes_parameters = false;    ///< as its last arguments, after "--"; otherwise none are accepted
    };

    command_runner(boost::asio::io_context& io, settings how, log_function log);

    void answer(const cles::request& what, const cles::responder& to);
    /// Kills all that run.
    void stop();

  private:
    struct job;
    static constexpr std::size_t most_waiting = 1024;

    void start_more();
    void start(const std::shared_ptr<job>& what);
    void withdraw(const std::shared_ptr<job>& what);

    boost::asio::io_context& io_;
    const settings how_;
    const log_function log_;
    std::deque<std::shared_ptr<job>> waiting_;
    std::set<std::shared_ptr<job>> running_;
    bool stopped_ = false;
};

} // namespace tool
