// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace dsgd {

/// Which nodes have come, or have been started again, and are to be asked whether they take part. It only decides.
class newcomers {
  public:
    /// \param names only these may take part; none: any
    explicit newcomers(std::vector<std::string> names = {}) : names_(std::move(names)) {}

    /// It takes part. \param epoch of its present run; empty: not known
    void joined(const std::string& node, const std::string& epoch) { members_[node] = epoch; }
    void left(const std::string& node) { members_.erase(node); }
    /// With their epochs.
    [[nodiscard]] const std::map<std::string, std::string>& members() const noexcept { return members_; }

    /// Those that are to be asked. Each is returned once, until it is started again or offers other tasks.
    std::vector<cles::peer> among(const std::vector<cles::peer>& peers);

  private:
    std::vector<std::string> names_;
    std::map<std::string, std::string> members_{};
    std::map<std::string, std::string> asked_{}; ///< the others, with epoch and tasks
};

} // namespace dsgd
