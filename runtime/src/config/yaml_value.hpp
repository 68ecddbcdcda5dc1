// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "config/config_values.hpp"

#include <yaml-cpp/yaml.h>

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// A value in the configuration file, which knows its key's full path and its line, so that a complaint names them.
/// Every function throws config_error.
class config_node {
  public:
    using reader = std::function<void(const config_node&)>;
    using readers = std::map<std::string_view, reader>;

    /// \param file as complaints name it \param origins filled with the places of all values that are read
    config_node(const YAML::Node& value, std::string key, const std::string& file,
                std::map<std::string, std::string>& origins);

    [[nodiscard]] bool is_text() const { return value_.IsScalar(); }
    [[nodiscard]] bool is_list() const { return value_.IsSequence(); }
    [[nodiscard]] const std::string& text() const;
    /// The text as what it stands for; `to` throws bad_value.
    template <class F>
    auto as(F to) const {
        try {
            return to(text());
        } catch (const bad_value& wrong) {
            refuse(wrong.what());
        }
    }

    /// Each key's value goes to its reader; a key without one is unknown.
    void map(const readers& known) const;
    /// The same for a map whose keys are names.
    void names(const std::function<void(const std::string&, const config_node&)>& each) const;
    void list(const reader& each) const;
    /// As JSON. The places of what it holds are kept too.
    [[nodiscard]] std::string json() const;

    [[noreturn]] void refuse(const std::string& why) const;

  private:
    void each_pair(const std::function<void(const std::string&, const config_node&)>& each) const;
    [[nodiscard]] std::string place() const;
    void keep_places(const YAML::Node& value, const std::string& key) const;

    YAML::Node value_;
    std::string key_;
    const std::string& file_;
    std::map<std::string, std::string>& origins_;
};

/// A plugin's part of the configuration as JSON: a map or a list; nothing is `{}`. What is not quoted and reads as a
/// number, true, false or null in JSON is one; all else is text.
/// \throws bad_value where it is neither, nests deeper than 32, or makes more than 1 MiB
std::string json_of(const YAML::Node& value);

} // namespace cles::runtime
