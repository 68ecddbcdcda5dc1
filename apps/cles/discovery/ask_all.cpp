// SPDX-License-Identifier: BSL-1.0
#include "discovery/ask_all.hpp"

#include "client/client.hpp"

#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <cstddef>
#include <memory>
#include <utility>

namespace tool {

namespace asio = boost::asio;

namespace {

/// Shared, because answers may arrive when the caller is gone.
class parallel_query : public std::enable_shared_from_this<parallel_query> {
  public:
    parallel_query(client& requester, std::size_t nodes)
        : requester_(requester), done_(requester.context(), asio::steady_timer::time_point::max()), answers_(nodes) {}

    void ask(std::size_t which, const std::string& noun, const std::string& url, std::chrono::milliseconds limit) {
        auto& answer = answers_[which];
        if (url.empty()) {
            answer.error = "no address that is reachable from this host";
            return;
        }
        ++pending_;
        cles::call_options options;
        options.at(url).deadline(limit).diagnostics(answer.error);
        const auto on_answer = [self = shared_from_this(), &answer](boost::system::error_code code,
                                                                    const cles::json_text& text) {
            answer.code = code;
            if (!code) {
                answer.error.clear();
                answer.json = text.text;
            } else if (answer.error.empty()) {
                answer.error = code.message();
            }
            if (--self->pending_ == 0) {
                self->done_.cancel();
            }
        };
        requester_.node().async_pull(noun, options, on_answer);
    }

    asio::awaitable<void> finish() {
        boost::system::error_code code;
        if (pending_ > 0) {
            co_await done_.async_wait(asio::redirect_error(asio::use_awaitable, code));
        }
        if (pending_ > 0) {
            throw boost::system::system_error(code); // interrupted
        }
    }
    [[nodiscard]] const std::vector<node_answer>& answers() const noexcept { return answers_; }

  private:
    client& requester_;
    asio::steady_timer done_;
    std::vector<node_answer> answers_;
    std::size_t pending_ = 0;
};

} // namespace

asio::awaitable<std::vector<node_answer>> ask_all(client& requester, std::string noun, std::vector<std::string> urls,
                                                  std::chrono::milliseconds limit) {
    const auto query = std::make_shared<parallel_query>(requester, urls.size());
    for (std::size_t i = 0; i < urls.size(); ++i) {
        query->ask(i, noun, urls[i], limit);
    }
    co_await query->finish();
    co_return query->answers();
}

} // namespace tool
