import { ActionIcon, Anchor, Box, Button, Group, SimpleGrid, Text, TextInput, Title } from "@mantine/core";
import { IconPencil } from "@tabler/icons-react";
import { useState } from "react";
import { Link } from "wouter";
import { pathOf, useDownload } from "../../api/files";
import { useRename } from "../../api/mutations";
import { problemOf } from "../../api/problems";
import { useCatalogue } from "../../api/queries";
import type { Campaign } from "../../api/types";
import { useVehicle } from "../../api/vehicles";
import { StateBadge } from "../../ui/Badges";
import { count } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { ErrorNotice } from "../../ui/Notices";
import panel from "../../ui/Panel.module.css";
import { campaignStateLabel } from "../../ui/states";
import { replacementOf } from "../../ui/units";
import classes from "./CampaignPage.module.css";
import { settingsOf } from "./campaignSettings";

/** Name, state, and the settings that proposals depend on. */
export function CampaignHeader({ campaign }: { campaign: Campaign }) {
  const [renaming, setRenaming] = useState(false);
  const catalogue = useCatalogue().data;
  const vehicle = useVehicle(campaign.vehicle.id) ?? campaign.vehicle;
  const replacement = catalogue && replacementOf(catalogue, campaign.definition.experiment);
  return (
    <Box component="header" mb={14}>
      <Group gap="0 16px">
        {renaming ? (
          <Rename campaign={campaign} onClose={() => setRenaming(false)} />
        ) : (
          <Group gap={4} wrap="nowrap" flex="1 1 300px" miw={0}>
            <Title order={1} lh={1.2} className={classes["name"]} title={campaign.name}>
              {campaign.name}
            </Title>
            <ActionIcon color="gray" aria-label="Rename campaign" title="Rename" onClick={() => setRenaming(true)}>
              <IconPencil size={18} color="var(--dim)" />
            </ActionIcon>
          </Group>
        )}
        <Exports campaign={campaign} />
      </Group>
      <Group gap="0 18px" c="dimmed" fz="small">
        <StateBadge
          words={campaignStateLabel({
            ...campaign,
            vehicle: { ...campaign.vehicle, state: vehicle.state },
            rehearsal: campaign.rehearsal.state,
          })}
        />
        <span>{count(campaign.trials.flown, "flight")}</span>
        <details className={classes["settings"]}>
          <summary>Settings</summary>
          <SimpleGrid
            component="dl"
            c="var(--ink)"
            minColWidth={200}
            spacing={20}
            verticalSpacing={10}
            className={panel["panel"]}
          >
            {settingsOf(campaign, catalogue).map(([title, value]) => (
              <LabelledValue key={title} title={title} value={value} />
            ))}
          </SimpleGrid>
        </details>
        <Anchor component={Link} to="/" py={4} fz="small" ms="auto">
          All campaigns
        </Anchor>
      </Group>
      {replacement !== undefined && (
        <Text c="dimmed" fz="small">
          New campaigns fly “{replacement}” instead, because the gains hardly change the error of a takeoff with this
          autopilot.
        </Text>
      )}
    </Box>
  );
}

const selected = (input: HTMLInputElement | null) => input?.select();

function Rename({ campaign, onClose }: { campaign: Campaign; onClose: () => void }) {
  const [name, setName] = useState(campaign.name);
  const rename = useRename(campaign);
  const problem = problemOf(rename.error);
  return (
    <Group
      component="form"
      gap={8}
      wrap="nowrap"
      align="start"
      onKeyDown={(event) => event.key === "Escape" && onClose()}
      onSubmit={(event) => {
        event.preventDefault();
        rename.mutate(name, { onSuccess: onClose });
      }}
    >
      <TextInput
        aria-label="Campaign name"
        w={480}
        value={name}
        maxLength={120}
        ref={selected}
        error={problem && [problem.detail || problem.title, problem.hint].join(" ")}
        onChange={(event) => setName(event.currentTarget.value)}
      />
      <Button type="submit" flex="none" loading={rename.isPending} disabled={name.trim() === ""}>
        Rename
      </Button>
      <Button variant="default" flex="none" onClick={onClose}>
        Cancel
      </Button>
    </Group>
  );
}

/** Report and bundle of the campaign; no bundle during a flight. */
function Exports({ campaign }: { campaign: Campaign }) {
  const pdf = useDownload(pathOf(campaign.id, "report.pdf"));
  const bundle = useDownload(pathOf(campaign.id, "bundle"));
  return (
    <Box flex="none" maw="100%" ms="auto">
      <Group gap={8}>
        <Button
          component="a"
          variant="default"
          href={pathOf(campaign.id, "report.html")}
          target="_blank"
          rel="noreferrer"
        >
          Open report
        </Button>
        <Button variant="default" loading={pdf.isPending} onClick={() => pdf.mutate()}>
          PDF
        </Button>
        {campaign.flying === null && (
          <Button variant="default" loading={bundle.isPending} onClick={() => bundle.mutate()}>
            Export bundle
          </Button>
        )}
      </Group>
      <ErrorNotice error={pdf.error ?? bundle.error} />
    </Box>
  );
}
