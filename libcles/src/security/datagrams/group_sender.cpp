// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/group_sender.hpp"

#include <limits>

#include <sodium.h>

namespace cles::security {

group_sender::group_sender(const fleet& of, entropy& random, std::uint64_t first_counter)
    : fleet_(of), random_(random), counter_(first_counter) {
    random_.fill(salt_);
}

void group_sender::draw_salt() {
    random_.fill(salt_);
    counter_ = 0;
}

void group_sender::refresh() {
    if (process_.forked()) {
        draw_salt();
    }
}

const group_salt& group_sender::salt() {
    refresh();
    return salt_;
}

std::uint64_t group_sender::next_counter() {
    refresh();
    return counter_;
}

bytes_view group_sender::seal(std::string_view line) {
    refresh();
    const auto generation = fleet_.ring().current();
    const auto* const key = fleet_.ring().find(generation);
    if (fleet_.self() == nullptr || key == nullptr || line.size() > max_line) {
        return {};
    }
    write_group_head(fleet_.self()->number, generation, salt_, counter_, sealed_.data());
    crypto_aead_xchacha20poly1305_ietf_encrypt(sealed_.data() + group_head_bytes, nullptr, as_bytes(line).data(),
                                               line.size(), sealed_.data(), group_head_bytes, nullptr,
                                               sealed_.data() + group_nonce_at, key->data());
    // The last counter is not used, so that the next one can always be stated.
    if (++counter_ == std::numeric_limits<std::uint64_t>::max()) {
        draw_salt();
    }
    return bytes_view{sealed_}.first(group_head_bytes + line.size() + seal_bytes);
}

} // namespace cles::security
