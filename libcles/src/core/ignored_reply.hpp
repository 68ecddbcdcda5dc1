// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

namespace cles::core {

/// The reply to a request whose outcome nobody waits for.
class ignored_reply final : public detail::pending {
  public:
    verdict offer(std::string_view) override {
        delete this;
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view) override { delete this; }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }
};

} // namespace cles::core
