"""The linear bodies: packed, condensed to the contact, with and without contact springs."""
