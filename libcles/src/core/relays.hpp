// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/counters.hpp"
#include "core/node.hpp"
#include "core/onward.hpp"
#include "core/topic.hpp"
#include "core/topic_source.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// What other nodes publish and this one passes on to its clients, by nouns as "car2:pose". Each is bound once, as long
/// as there are clients for it, and its updates are passed on as they came; thinned and queued they are here, for each
/// client apart.
class relays final : public topic_source {
  public:
    /// `wake` is called when there is something to drain, once until `drain`.
    relays(node& host, onward& out, std::function<void()> wake);
    ~relays();
    void stop() noexcept { stopped_ = true; }

    /// The topic to bind to, with the noun's last value; or null, and why there is none.
    using told = std::function<void(topic*, std::string_view last, const protocol::failure& why)>;
    /// Has a noun bound. Tells of it once, at once where it is bound already, as long as `whose` lives.
    void join(std::string_view node, std::string_view path, std::string_view adverbs,
              const std::weak_ptr<const void>& whose, told tell);

    /// Which update the last value of a topic is; nothing where that is not known.
    [[nodiscard]] std::optional<update_mark> mark_of(const topic& t) const;

    [[nodiscard]] topic* find(std::string_view noun) noexcept override;
    void release(topic& t) override;
    void admit(topic&) override {}
    /// Puts to clients what has come since the last time.
    void drain(time_point now);
    [[nodiscard]] std::size_t size() const noexcept { return all_.size(); }

  private:
    class relay;

    void mark(topic& t);
    void close(relay& r);

    node& node_;
    onward& out_;
    std::function<void()> wake_;
    counters counts_; // what is passed on is not this node's to count as published
    std::map<std::string, std::unique_ptr<relay>, std::less<>> all_;
    std::vector<topic*> dirty_;
    bool stopped_ = false;
};

} // namespace cles::core
