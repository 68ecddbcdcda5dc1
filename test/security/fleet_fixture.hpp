// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/roster.hpp"
#include "security/hex.hpp"
#include "security/keys/keys.hpp"
#include "support/temporary_folder.hpp"

#include <boost/json.hpp>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

/// What the tests of the fleet share: the test vectors, keys that are the same in each run, a folder of their own.

namespace cles::security::test {

inline std::string read_file(const std::filesystem::path& path) {
    std::ifstream in{path, std::ios::binary};
    if (!in) {
        throw std::runtime_error{"cannot read " + path.string()};
    }
    return {std::istreambuf_iterator<char>{in}, {}};
}

inline void write_file(const std::filesystem::path& path, std::string_view text) {
    std::ofstream{path, std::ios::binary} << text;
}

/// test/security/vectors.json
inline const boost::json::object& vectors() {
    static const auto read = boost::json::parse(read_file("test/security/vectors.json")).as_object();
    return read;
}

inline std::string text_at(const boost::json::object& in, std::string_view key) {
    return boost::json::value_to<std::string>(in.at(key));
}

/// A key of the vectors: fleet, car1, car2.
inline signing_key vector_key(std::string_view whose) {
    return signing_key{secret_bytes{from_hex(text_at(vectors().at("keys").at(whose).as_object(), "seed"))}};
}

/// A key of its own for each name.
inline signing_key key_of(std::string_view name) {
    std::vector<std::uint8_t> seed(32);
    for (std::size_t i = 0; i < name.size(); ++i) {
        seed[i % seed.size()] =
            static_cast<std::uint8_t>(seed[i % seed.size()] * 31U + static_cast<unsigned char>(name[i]));
    }
    return signing_key{secret_bytes{seed}};
}

inline public_identity node(std::string_view name) { return {std::string{name}, key_of(name).public_part()}; }

/// A new fleet, of the key `fleet`, with these nodes.
inline fleet_authority authority_with(std::initializer_list<std::string_view> names) {
    auto made = fleet_authority::found(key_of("fleet"));
    for (const auto name : names) {
        made.add(node(name));
    }
    return made;
}

inline std::shared_ptr<const roster> reread(const std::string& line) {
    return roster::read(line, roster::named_fleet(line));
}

/// A temporary folder, and what is in it.
class own_folder {
  public:
    [[nodiscard]] std::string path() const { return folder_.path().string(); }
    [[nodiscard]] std::filesystem::path operator/(std::string_view name) const { return folder_ / name; }
    /// The names of its files, sorted.
    [[nodiscard]] std::vector<std::string> names() const {
        std::vector<std::string> found;
        for (const auto& entry : std::filesystem::directory_iterator{folder_.path()}) {
            found.push_back(entry.path().filename().string());
        }
        std::sort(found.begin(), found.end());
        return found;
    }

  private:
    cles::test::temporary_folder folder_{"cles-security"};
};

/// The message of the error that the call throws; empty if it throws none.
template <class Call>
std::string refusal(Call call) {
    try {
        static_cast<void>(call());
        return {};
    } catch (const security_error& e) {
        return e.what();
    }
}

inline bool contains(std::string_view text, std::string_view part) { return text.find(part) != std::string_view::npos; }

/// The text with the first occurrence of a part replaced, which must be there.
inline std::string replaced(std::string text, std::string_view part, std::string_view by) {
    const auto at = text.find(part);
    if (at == std::string::npos) {
        throw std::runtime_error{"does not occur: " + std::string{part}};
    }
    return text.replace(at, part.size(), by);
}

} // namespace cles::security::test
