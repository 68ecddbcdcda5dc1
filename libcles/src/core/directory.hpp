// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace cles::core {

/// Where nodes are, as far as somebody has said so.
class directory {
  public:
    /// An empty URL forgets the node.
    void set(std::string_view name, std::string_view url) {
        if (url.empty()) {
            if (const auto found = urls_.find(name); found != urls_.end()) {
                urls_.erase(found);
            }
        } else {
            urls_.insert_or_assign(std::string{name}, std::string{url});
        }
    }
    /// The node's URL; empty where it is not known.
    [[nodiscard]] std::string_view find(std::string_view name) const noexcept {
        const auto found = urls_.find(name);
        return found == urls_.end() ? std::string_view{} : std::string_view{found->second};
    }

  private:
    std::map<std::string, std::string, std::less<>> urls_;
};

} // namespace cles::core
