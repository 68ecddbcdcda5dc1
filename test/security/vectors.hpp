// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys.hpp"

#include <boost/json/value.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::test {

/// test/security/vectors.json
class vectors {
  public:
    vectors();

    [[nodiscard]] security::signing_key key(std::string_view name) const;
    [[nodiscard]] std::string text(std::string_view object, std::string_view key) const;
    [[nodiscard]] std::uint64_t number(std::string_view object, std::string_view key) const;
    [[nodiscard]] std::string roster() const;
    [[nodiscard]] std::string ephemeral(std::size_t which) const;

    struct data_vector {
        std::string from;
        std::uint64_t counter;
        std::string line;
        std::string datagram;
    };
    [[nodiscard]] std::vector<data_vector> data() const;

  private:
    boost::json::value all_;
};

} // namespace cles::test
