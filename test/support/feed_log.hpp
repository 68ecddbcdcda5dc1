// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A feed from which events are fetched continuously, and all its events.
class feed_log {
  public:
    using item = feed_item<json_text>;

    feed_log() = default;
    feed_log(const feed_log&) = delete;
    feed_log& operator=(const feed_log&) = delete;
    ~feed_log() { close(); }

    void bind(service& from, std::string_view noun, bind_options options = {}) {
        from.async_bind(noun, options.diagnostics(words), taker{this, alive_});
    }
    void close() {
        feed<json_text> closing = std::move(feed_);
        closing.close();
    }
    /// Stops or resumes fetching.
    void hold(bool still) {
        held_ = still;
        fetch();
    }

    std::vector<item> items{};
    bool bound = false;               ///< `async_bind` has succeeded
    int binds = 0;                    ///< how often it completed
    int ends = 0;                     ///< how often `async_next` failed
    boost::system::error_code code{}; ///< of the bind, or of what ended the feed
    std::string words{};

    [[nodiscard]] bool is_over() const noexcept { return ends != 0; }
    [[nodiscard]] std::size_t count(feed_event kind) const {
        return static_cast<std::size_t>(
            std::count_if(items.begin(), items.end(), [kind](const item& i) { return i.kind == kind; }));
    }
    /// The bodies of its updates (not of the current value).
    [[nodiscard]] std::vector<std::string> bodies() const {
        std::vector<std::string> result;
        for (const auto& i : items) {
            if (i.kind == feed_event::update) {
                result.push_back(i.value.text);
            }
        }
        return result;
    }
    [[nodiscard]] std::uint64_t missed() const {
        std::uint64_t sum = 0;
        for (const auto& i : items) {
            sum += i.missed;
        }
        return sum;
    }

  private:
    struct taker {
        feed_log* log;
        std::weak_ptr<bool> alive; // expired: the log has been destroyed
        void operator()(boost::system::error_code failed, feed<json_text> made) const {
            if (alive.expired()) {
                return;
            }
            ++log->binds;
            log->code = failed;
            if (!failed) {
                log->bound = true;
                log->feed_ = std::move(made);
                log->fetch();
            }
        }
        void operator()(boost::system::error_code failed, item next) const {
            if (alive.expired()) {
                return;
            }
            log->fetching_ = false;
            if (failed) {
                ++log->ends;
                log->code = failed;
                return;
            }
            log->items.push_back(std::move(next));
            log->fetch();
        }
    };

    void fetch() {
        if (feed_.is_open() && !held_ && !fetching_) {
            fetching_ = true;
            feed_.async_next(taker{this, alive_});
        }
    }

    feed<json_text> feed_;
    std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
    bool held_ = false;
    bool fetching_ = false;
};

} // namespace cles::test
