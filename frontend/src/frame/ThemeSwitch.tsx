import { ActionIcon, useComputedColorScheme, useMantineColorScheme } from "@mantine/core";
import { IconMoon, IconSun } from "@tabler/icons-react";

export function ThemeSwitch() {
  const { setColorScheme } = useMantineColorScheme();
  const dark = useComputedColorScheme("light") === "dark";
  const next = dark ? "light" : "dark";
  return (
    <ActionIcon
      color="gray"
      variant="subtle"
      aria-label={`Switch to the ${next} theme`}
      title={`Switch to the ${next} theme`}
      onClick={() => setColorScheme(next)}
    >
      {dark ? <IconSun size={22} color="var(--ink)" /> : <IconMoon size={22} color="var(--ink)" />}
    </ActionIcon>
  );
}
