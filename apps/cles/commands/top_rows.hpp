// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "commands/node_rates.hpp"
#include "discovery/listed_node.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace tool {

/// A node as `cles top` shows it.
struct top_row {
    listed_node node; ///< `error`: why it did not tell what it does
    node_rate rate{};
};

enum class top_order : std::uint8_t { load, name };

/// By load: who has most to do for each worker first.
void sort_rows(std::vector<top_row>& rows, top_order order);

/// One line about all of them.
std::string summary_of(const std::vector<top_row>& rows);
std::string to_table(const std::vector<top_row>& rows);
std::string to_json(const std::vector<top_row>& rows);

} // namespace tool
