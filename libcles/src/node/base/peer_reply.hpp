// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include <boost/system/error_code.hpp>

#include <functional>
#include <string_view>
#include <utility>

namespace cles::core {

/// How a request to another node has ended. Views are valid during the call that reports it.
struct peer_answer {
    std::string_view json{};          ///< empty if it failed
    boost::system::error_code code{}; ///< why it failed; none: it has not
    std::string_view message{};       ///< the same in words
    std::string_view refusal{};       ///< the reply of the node that was asked, if it has refused it
};

/// An operation of the library that passes the outcome of its request on.
class peer_reply final : public detail::pending {
  public:
    using function = std::function<void(const peer_answer& found)>;

    /// `checks_json`: replies that are not JSON do not count.
    explicit peer_reply(function then, bool checks_json = false) : then_(std::move(then)), checks_json_(checks_json) {}

    verdict offer(std::string_view json) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override;
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    void finish(const peer_answer& found);

    function then_;
    bool checks_json_;
};

} // namespace cles::core
