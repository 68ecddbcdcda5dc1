// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "figures.hpp"
#include "output/statistics.hpp"
#include "output/table.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// How reports are printed as tables.
namespace tool {

/// "-" where there is nothing.
std::string fixed(std::optional<double> value, int digits);
/// A ratio, as in "1.17x".
std::string times(double ratio);
std::string times(std::optional<double> ratio);

/// Lines of a name and its figures.
class rows {
  public:
    explicit rows(const std::vector<std::string>& titles) {
        for (const auto& title : titles) {
            table_.column(title);
        }
    }
    void add(const std::vector<std::string>& cells) {
        table_.row();
        for (std::size_t i = 0; i < cells.size(); ++i) {
            table_.set(i, cells[i], i != 0);
        }
    }
    void add(const std::string& name, const latency_figures& figures);
    void add_ratio(const std::string& name, const latency_figures& of, const latency_figures& to);
    [[nodiscard]] std::string text() const { return table_.text(); }

  private:
    table table_;
};

std::string cores(int client, std::optional<int> server);
/// The plural of a style's name.
std::string styles(const std::string& style);
/// How the ends wait for work.
std::string waiting(std::int64_t busy_poll_us, std::optional<std::int64_t> wake_within_us);

} // namespace tool
