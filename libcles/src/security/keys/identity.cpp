// SPDX-License-Identifier: BSL-1.0
#include "security/keys/identity.hpp"

#include "protocol/grammar.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>

#include <sodium.h>

namespace cles::security {
namespace {

constexpr std::size_t key_text_size = 43; // of 32 bytes
constexpr std::size_t seed_size = crypto_sign_SEEDBYTES;
constexpr auto key_text_variant = sodium_base64_VARIANT_URLSAFE_NO_PADDING;

constexpr std::string_view name_start = R"({"name":")";
constexpr std::string_view key_start = R"(","key":")";
constexpr std::string_view seed_start = R"(","seed":")";
constexpr std::string_view fleet_seed_start = R"({"seed":")";
constexpr std::string_view key_end = R"("})";

// Splits a line of a name and a key. The parts are views of it, so that a secret is not copied.
struct named_key {
    std::string_view name;
    std::string_view key;
};

std::optional<named_key> split_named_key(std::string_view line, std::string_view middle) {
    line.remove_suffix(line.ends_with('\n') ? 1 : 0);
    const auto fixed = name_start.size() + middle.size() + key_text_size + key_end.size();
    if (line.size() < fixed || !line.starts_with(name_start) || !line.ends_with(key_end)) {
        return {};
    }
    const auto name = line.substr(name_start.size(), line.size() - fixed);
    const auto rest = line.substr(name_start.size() + name.size());
    if (!rest.starts_with(middle)) {
        return {};
    }
    return named_key{name, rest.substr(middle.size(), key_text_size)};
}

std::optional<signing_key> read_seed(std::string_view text) {
    secret_bytes seed{seed_size};
    if (!read_base64url(text, seed.span())) {
        return {};
    }
    return signing_key{std::move(seed)};
}

// A line of these parts, the seed and `key_end`.
secret_bytes line_with_seed(std::initializer_list<std::string_view> parts, const signing_key& key) {
    std::size_t size = 0;
    for (const auto part : parts) {
        size += part.size();
    }
    secret_bytes line{size + key_text_size + key_end.size() + 1};
    auto* at = line.data();
    for (const auto part : parts) {
        at = std::ranges::copy(part, at).out;
    }
    // It writes a terminating zero, which is then overwritten.
    sodium_bin2base64(reinterpret_cast<char*>(at), key_text_size + 1, key.seed().data(), seed_size, key_text_variant);
    at = std::ranges::copy(key_end, at + key_text_size).out;
    *at = '\n';
    return line;
}

} // namespace

std::string flaw_of_node_name(std::string_view text) {
    if (!protocol::is_name(text)) {
        return protocol::quoted(text) + " is not a name of a node (1 to 64 letters, digits, '_', '-', '.')";
    }
    if (protocol::is_reserved_target(text)) {
        return protocol::quoted(text) + " is reserved and cannot be the name of a node";
    }
    return {};
}

void require_node_name(std::string_view name) {
    if (const auto flaw = flaw_of_node_name(name); !flaw.empty()) {
        throw security_error{flaw};
    }
}

std::string fingerprint_of(const public_identity& identity) {
    prepare_sodium();
    auto text = "cles fingerprint 1\n" + identity.name + "\n";
    text.append(as_text(identity.key));
    std::array<std::uint8_t, crypto_hash_sha256_BYTES> digest{};
    crypto_hash_sha256(digest.data(), as_bytes(text).data(), text.size());
    constexpr std::size_t shown = 10; // bytes
    constexpr std::size_t group = 2;
    constexpr std::string_view digits = "0123456789abcdef";
    std::string out;
    for (std::size_t i = 0; i < shown; ++i) {
        if (i != 0 && i % group == 0) {
            out.push_back('-');
        }
        const std::size_t byte = digest[i];
        out.push_back(digits[byte / 16]);
        out.push_back(digits[byte % 16]);
    }
    return out;
}

std::string to_line(const public_identity& identity) {
    std::string line{name_start};
    line.append(identity.name).append(key_start).append(to_base64url(identity.key)).append(key_end).append("\n");
    return line;
}

secret_bytes to_line(const node_identity& identity) {
    return line_with_seed({name_start, identity.name, seed_start}, identity.key);
}

secret_bytes fleet_key_line(const signing_key& key) { return line_with_seed({fleet_seed_start}, key); }

public_identity read_public_identity(std::string_view line) {
    public_identity identity;
    const auto parts = split_named_key(line, key_start);
    if (!parts || !read_base64url(parts->key, identity.key)) {
        throw security_error{R"(expected a line of the form {"name":"car1","key":"<43 characters>"})"};
    }
    require_node_name(parts->name);
    if (!agreement_form(identity.key)) {
        throw security_error{"the key is not valid"};
    }
    identity.name = parts->name;
    return identity;
}

node_identity read_node_identity(bytes_view line) {
    const auto parts = split_named_key(as_text(line), seed_start);
    auto key = parts ? read_seed(parts->key) : std::nullopt;
    if (!key) {
        throw security_error{R"(expected a line of the form {"name":"car1","seed":"<43 characters>"})"};
    }
    require_node_name(parts->name);
    return {std::string{parts->name}, std::move(*key)};
}

signing_key read_fleet_key(bytes_view line) {
    auto text = as_text(line);
    text.remove_suffix(text.ends_with('\n') ? 1 : 0);
    if (text.size() == fleet_seed_start.size() + key_text_size + key_end.size() && text.starts_with(fleet_seed_start) &&
        text.ends_with(key_end)) {
        if (auto key = read_seed(text.substr(fleet_seed_start.size(), key_text_size))) {
            return std::move(*key);
        }
    }
    throw security_error{R"(expected a line of the form {"seed":"<43 characters>"})"};
}

} // namespace cles::security
