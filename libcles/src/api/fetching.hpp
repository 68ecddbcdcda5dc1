// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/feed.hpp>

#include "core/feed_mailbox.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/post.hpp>

#include <memory>
#include <utility>

namespace cles::api {

/// One call of `async_next`: it ends with the next event, or fails where there can be none; never from inside this
/// call. `owner` keeps the mailbox.
inline void fetch_next(core::feed_mailbox& from, const boost::asio::any_io_executor& executor,
                       std::shared_ptr<detail::feed_control> owner, detail::event_ptr operation) {
    if (from.closed() || from.has_waiter()) {
        const auto code = make_error_code(from.closed() ? errc::stopped : errc::busy);
        boost::asio::post(executor, [operation = std::move(operation), code]() mutable {
            operation.release()->fail(code, code == errc::busy ? "another async_next of this feed waits"
                                                               : "the feed is closed");
        });
        return;
    }
    if (from.next(std::move(operation))) {
        boost::asio::post(executor, [&from, owner = std::move(owner)] { from.pump(); });
    }
}

} // namespace cles::api
