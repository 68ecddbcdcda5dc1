// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "core/name_check.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::shell {

class local_node;

/// The answer of a run of a node that was asked whether it is there, or its silence.
class probe_reply final : public detail::pending {
  public:
    probe_reply(std::weak_ptr<local_node> host, std::uint64_t ticket, std::string url)
        : host_(std::move(host)), ticket_(ticket), url_(std::move(url)) {}

    verdict offer(std::string_view json) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override;
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    void tell(core::probe_outcome found) const;

    std::weak_ptr<local_node> host_;
    std::uint64_t ticket_;
    std::string url_;
};

} // namespace cles::shell
