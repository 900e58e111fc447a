import { Anchor, Box, Button, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { IconPlus } from "@tabler/icons-react";
import { Link } from "wouter";
import { useCreateCampaign } from "../../api/mutations";
import { useCatalogue } from "../../api/queries";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import panel from "../../ui/Panel.module.css";
import page from "../campaign/CampaignPage.module.css";
import { firstPreset, openCampaign } from "../new-campaign/newCampaign";
import { ImportBundle } from "./ImportBundle";

const STEPS = [
  [
    "Fly",
    "The vehicle takes off with its default gains. The error is the mean distance from 3\u00a0m over 32.6\u00a0s.",
  ],
  ["Learn", "The flight is compared with a simple model, and the difference corrects the next prediction."],
  ["Step", "Gainline proposes the best of many gain sets on the model. You see why, and decide."],
] as const;

/** Empty list: explains campaigns, and creates the first one with one click. */
export function FirstCampaign() {
  const catalogue = useCatalogue();
  const create = useCreateCampaign();
  const preset = catalogue.data && firstPreset(catalogue.data);
  return (
    <Stack component="section" align="center" gap={14} maw={820} mx="auto" mt="3vh" ta="center">
      <Drawing />
      <Title order={1} lh={1.15}>
        Tune a takeoff in a few flights
      </Title>
      <Note maw={560} fz="strong" lh={1.5}>
        A campaign flies one vehicle repeatedly, each time with new gains, and stops when no further improvement is
        found.
      </Note>
      <SimpleGrid component="ol" minColWidth={210} autoFlow="auto-fit" spacing={14} w="100%" mt={8} mb={10} ta="left">
        {STEPS.map(([title, text], index) => (
          <li key={title} className={panel["panel"]}>
            <Text fz="body" fw={650}>
              <Text span inherit c="var(--best)">
                {index + 1}.
              </Text>{" "}
              {title}
            </Text>
            <Note fz="body">{text}</Note>
          </li>
        ))}
      </SimpleGrid>
      <Button
        size="lg"
        maw="100%"
        className={page["wrapping"]}
        loading={create.isPending}
        disabled={preset === undefined}
        leftSection={<IconPlus size={22} aria-hidden />}
        onClick={() => preset && create.mutate(preset.campaign, { onSuccess: openCampaign })}
      >
        Create “{preset?.title ?? "AR.Drone takeoff to 3 m, simulated"}”
      </Button>
      <Anchor component={Link} to="/new" display="inline-block" py={12}>
        Choose a preset or settings first
      </Anchor>
      <ImportBundle />
      <ErrorNotice error={catalogue.error ?? create.error} />
    </Stack>
  );
}

/** Three takeoffs, each closer to the dotted set point. */
function Drawing() {
  return (
    <Box component="svg" w="min(420px, 90%)" viewBox="0 0 420 130" fill="none" strokeLinecap="round" aria-hidden>
      <path d="M10 48H410" stroke="var(--edge)" strokeWidth={1.5} strokeDasharray="2 6" />
      <path
        d="M10 120C46 120 56 12 96 12s64 46 122 34 60-34 102-22 52 20 90 22"
        stroke="var(--earlier)"
        strokeWidth={1.5}
      />
      <path d="M10 120C42 120 52 28 86 28s50 30 94 24 70-8 230-4" stroke="var(--earlier)" strokeWidth={2} />
      <path d="M10 120C40 120 46 44 78 44s36 6 78 4 120 0 254 0" stroke="var(--best)" strokeWidth={4} />
    </Box>
  );
}
