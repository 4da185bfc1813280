"""NAV: following requests through houses (3.2.4.2)."""
