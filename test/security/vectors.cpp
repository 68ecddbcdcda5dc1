// SPDX-License-Identifier: BSL-1.0
#include "security/vectors.hpp"

#include "security/sealed_network.hpp"

#include <boost/json/parse.hpp>

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace cles::test {
namespace {

std::string text_of(const boost::json::value& value) { return std::string{value.as_string()}; }

} // namespace

vectors::vectors() {
    std::ifstream file{"test/security/vectors.json"};
    std::ostringstream text;
    if (!(text << file.rdbuf())) {
        throw std::runtime_error{"vectors.json cannot be read"};
    }
    all_ = boost::json::parse(text.str());
}

security::signing_key vectors::key(std::string_view name) const {
    return security::signing_key{security::secret_bytes{from_hex(text_of(all_.at("keys").at(name).at("seed")))}};
}

std::string vectors::text(std::string_view object, std::string_view key) const {
    return text_of(all_.at(object).at(key));
}

std::uint64_t vectors::number(std::string_view object, std::string_view key) const {
    return all_.at(object).at(key).to_number<std::uint64_t>();
}

std::string vectors::roster() const { return text_of(all_.at("roster")); }

std::string vectors::ephemeral(std::size_t which) const {
    return text_of(all_.at("handshake").at("ephemeral_secrets").as_array().at(which));
}

std::vector<vectors::data_vector> vectors::data() const {
    std::vector<data_vector> found;
    for (const auto& entry : all_.at("data").as_array()) {
        found.push_back({text_of(entry.at("from")), entry.at("counter").to_number<std::uint64_t>(),
                         text_of(entry.at("line")), text_of(entry.at("datagram"))});
    }
    return found;
}

} // namespace cles::test
