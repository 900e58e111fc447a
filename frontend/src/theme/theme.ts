import { createTheme, type MantineColorsTuple } from "@mantine/core";

/** The accent: primary actions and the best flight. Shade 7 carries white text at 5:1. */
const petrol: MantineColorsTuple = [
  "#e6f7f4",
  "#cdeee8",
  "#9bdcd1",
  "#65c9b8",
  "#3fd0bb",
  "#1c9f8e",
  "#0d8b7c",
  "#0a7a6c",
  "#06655a",
  "#034f46",
];

export const TOUCH_TARGET_PX = 48;

export const theme = createTheme({
  colors: { petrol },
  primaryColor: "petrol",
  primaryShade: 7,
  defaultRadius: "md",
  radius: { md: "10px" },
  fontFamily: "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'DejaVu Sans', sans-serif",
  headings: { fontWeight: "650" },
  cursorType: "pointer",
  respectReducedMotion: true,
  components: {
    Button: { defaultProps: { size: "md" }, styles: { root: { minHeight: TOUCH_TARGET_PX } } },
    ActionIcon: { defaultProps: { size: TOUCH_TARGET_PX, variant: "subtle" } },
    TextInput: { defaultProps: { size: "md" } },
    NumberInput: { defaultProps: { size: "md" } },
    Select: { defaultProps: { size: "md" } },
    Textarea: { defaultProps: { size: "md" } },
    FileInput: { defaultProps: { size: "md" } },
  },
});
