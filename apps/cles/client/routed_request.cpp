// SPDX-License-Identifier: BSL-1.0
#include "client/routed_request.hpp"

#include "client/client.hpp"

#include <exception>
#include <utility>

namespace tool {

namespace asio = boost::asio;

namespace {

// The node does not route or cannot be reached: another one may.
bool is_refused_by_router(const cles::error& e) {
    return e.code() == cles::errc::no_target || e.code().category() != cles::error_category();
}

} // namespace

asio::awaitable<cles::json_text> send_routed(client& requester, const std::string& command, cles::call_options& options,
                                             std::vector<std::string>& routers) {
    std::exception_ptr first_failure; // of the most likely router
    const auto candidates = std::exchange(routers, {});
    for (const auto& url : candidates) {
        options.at(url); // and of all further requests, if it answers
        try {
            cles::json_text answer = co_await requester.node().async_request(command, options);
            co_return answer;
        } catch (const cles::error& e) {
            if (!is_refused_by_router(e)) {
                throw;
            }
            first_failure = first_failure ? first_failure : std::current_exception();
        }
    }
    if (first_failure) {
        std::rethrow_exception(first_failure);
    }
    cles::json_text answer = co_await requester.node().async_request(command, options);
    co_return answer;
}

} // namespace tool
