// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/responder.hpp>

#include <boost/asio/any_io_executor.hpp>

#include <memory>
#include <string_view>

namespace cles::detail {

class engine;

/// The feeds that one job has bound, as the job sees them: only programs whose jobs bind contain more.
class job_feed_list {
  public:
    job_feed_list() = default;
    job_feed_list(const job_feed_list&) = delete;
    job_feed_list& operator=(const job_feed_list&) = delete;
    virtual ~job_feed_list() = default;
    virtual void close() noexcept = 0;
    /// Closes them in its turn: calls are stopped in loops over links.
    virtual void close_soon(const core::call& of) = 0;
};

/// What a job of a service wants to bind.
struct job_feed_request {
    std::shared_ptr<engine> service; ///< null: it is gone
    bool ended = false;              ///< the job
    const boost::asio::any_io_executor* executor = nullptr;
    std::weak_ptr<call_control> job; ///< fails with what callbacks throw
    std::string_view noun;
    const bind_options* options = nullptr;
    std::shared_ptr<job_feed_list>* feeds = nullptr; ///< where those of the job are; made with the first
};

} // namespace cles::detail
